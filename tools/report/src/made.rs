//! A design with what its user should know of it.

use crate::warnings;
use design_file::Loaded;
use design_file::schema::DesignFile;
use design_file::values::NameOrList;
use ftc_design::Design;
use ftc_design::assembly::Request;
use ftc_design::warnings::LoggedMovement;

/// A design, and what its user should know of it: one sentence each.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Made {
    /// The design.
    pub design: Design,
    /// What is worth knowing.
    pub warnings: Vec<String>,
}

impl Made {
    /// A design and the warnings that were told of it before.
    pub fn again(design: Design, warnings: Vec<String>) -> Self {
        Self { design, warnings }
    }
}

/// What the warnings of a design take from its design file.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Source {
    file: DesignFile,
    logged: Option<LoggedMovement>,
    /// What the user should know of the files that the design file names.
    pub notes: Vec<String>,
}

impl Source {
    /// What a design file asks for, and what its warnings need.
    pub fn split(loaded: Loaded) -> (Request, Self) {
        let logged = LoggedMovement::of(&loaded.request.estimator.database);
        let source = Self {
            file: loaded.file,
            logged,
            notes: loaded.notes,
        };
        (loaded.request, source)
    }

    /// The logs that the design file names, if it does.
    pub fn logs(&self) -> Option<&NameOrList> {
        self.file.estimator.logs()
    }

    /// The design that was made of it, with its warnings.
    pub fn made(self, design: Design) -> Made {
        let mut warnings = self.notes;
        warnings.extend(warnings::of_design(
            &self.file,
            self.logged.as_ref(),
            &design,
        ));
        Made { design, warnings }
    }
}
