//! Off line: gains, observers, predictor and certificate.
