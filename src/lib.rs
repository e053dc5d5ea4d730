//! Sensor-fault-tolerant control of switched linear systems.
