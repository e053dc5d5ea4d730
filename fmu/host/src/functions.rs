//! The C functions of one binary.

use fmu_abi::types::*;
use std::path::{Path, PathBuf};

macro_rules! functions {
    ($($field:ident = $name:literal ($($argument:ty),*) $(-> $result:ty)?;)*) => {
        /// The functions an importer calls, by address.
        #[derive(Clone, Copy, Debug)]
        #[allow(missing_docs, reason = "the names are the standard's")]
        pub struct Functions {
            $(pub $field: unsafe extern "C" fn($($argument),*) $(-> $result)?),*
        }

        impl Functions {
            /// The functions of a loaded library.
            ///
            /// # Safety
            /// The library is an FMU's and outlives the result.
            unsafe fn of(library: &libloading::Library) -> Result<Self, libloading::Error> {
                // SAFETY: by contract; the types are the standard's.
                unsafe { Ok(Self { $($field: *library.get(concat!($name, "\0").as_bytes())?),* }) }
            }
        }

        /// The functions of the FMU that is linked into this program.
        #[macro_export]
        macro_rules! linked {
            () => {{
                use $crate::types::*;
                unsafe extern "C" {
                    $(#[link_name = $name] fn $field($(_: $argument),*) $(-> $result)?;)*
                }
                $crate::Functions { $($field),* }
            }};
        }
    };
}

functions! {
    instantiate = "fmi2Instantiate"(Text, Choice, Text, Text, *const CallbackFunctions, Boolean, Boolean) -> Pointer;
    free_instance = "fmi2FreeInstance"(Pointer);
    set_debug_logging = "fmi2SetDebugLogging"(Pointer, Boolean, usize, *const Text) -> Status;
    setup_experiment = "fmi2SetupExperiment"(Pointer, Boolean, Real, Real, Boolean, Real) -> Status;
    enter_initialization_mode = "fmi2EnterInitializationMode"(Pointer) -> Status;
    exit_initialization_mode = "fmi2ExitInitializationMode"(Pointer) -> Status;
    terminate = "fmi2Terminate"(Pointer) -> Status;
    reset = "fmi2Reset"(Pointer) -> Status;
    get_real = "fmi2GetReal"(Pointer, *const ValueReference, usize, *mut Real) -> Status;
    get_integer = "fmi2GetInteger"(Pointer, *const ValueReference, usize, *mut Integer) -> Status;
    get_boolean = "fmi2GetBoolean"(Pointer, *const ValueReference, usize, *mut Boolean) -> Status;
    get_string = "fmi2GetString"(Pointer, *const ValueReference, usize, *mut Text) -> Status;
    set_real = "fmi2SetReal"(Pointer, *const ValueReference, usize, *const Real) -> Status;
    set_integer = "fmi2SetInteger"(Pointer, *const ValueReference, usize, *const Integer) -> Status;
    set_boolean = "fmi2SetBoolean"(Pointer, *const ValueReference, usize, *const Boolean) -> Status;
    set_string = "fmi2SetString"(Pointer, *const ValueReference, usize, *const Text) -> Status;
    get_fmu_state = "fmi2GetFMUstate"(Pointer, *mut Pointer) -> Status;
    set_fmu_state = "fmi2SetFMUstate"(Pointer, Pointer) -> Status;
    free_fmu_state = "fmi2FreeFMUstate"(Pointer, *mut Pointer) -> Status;
    serialized_fmu_state_size = "fmi2SerializedFMUstateSize"(Pointer, Pointer, *mut usize) -> Status;
    serialize_fmu_state = "fmi2SerializeFMUstate"(Pointer, Pointer, *mut Byte, usize) -> Status;
    deserialize_fmu_state = "fmi2DeSerializeFMUstate"(Pointer, *const Byte, usize, *mut Pointer) -> Status;
    get_directional_derivative = "fmi2GetDirectionalDerivative"(
        Pointer, *const ValueReference, usize, *const ValueReference, usize, *const Real, *mut Real) -> Status;
    set_real_input_derivatives = "fmi2SetRealInputDerivatives"(
        Pointer, *const ValueReference, usize, *const Integer, *const Real) -> Status;
    get_real_output_derivatives = "fmi2GetRealOutputDerivatives"(
        Pointer, *const ValueReference, usize, *const Integer, *mut Real) -> Status;
    do_step = "fmi2DoStep"(Pointer, Real, Real, Boolean) -> Status;
    cancel_step = "fmi2CancelStep"(Pointer) -> Status;
    get_status = "fmi2GetStatus"(Pointer, Choice, *mut Choice) -> Status;
    get_real_status = "fmi2GetRealStatus"(Pointer, Choice, *mut Real) -> Status;
    get_integer_status = "fmi2GetIntegerStatus"(Pointer, Choice, *mut Integer) -> Status;
    get_boolean_status = "fmi2GetBooleanStatus"(Pointer, Choice, *mut Boolean) -> Status;
    get_string_status = "fmi2GetStringStatus"(Pointer, Choice, *mut Text) -> Status;
}

/// A library that is loaded at run time, as every importer does it.
#[derive(Debug)]
pub struct Library {
    /// Its functions, good as long as it is loaded.
    pub functions: Functions,
    library: libloading::Library,
}

impl Library {
    /// Loads one of this project's binaries, such as `ftc_controller`, from where cargo leaves
    /// it: beside the running test, example or benchmark.
    pub fn load(name: &str) -> Self {
        let path = beside(
            &std::env::current_exe().expect("the program has a path"),
            name,
        );
        // SAFETY: our own binaries run nothing when they are loaded.
        let library = unsafe { libloading::Library::new(&path) }.expect("the binary loads");
        // SAFETY: the library is kept as long as its functions.
        let functions = unsafe { Functions::of(&library) }.expect("all functions are there");
        Self { functions, library }
    }

    /// Unloads it; every instance must be gone.
    pub fn unload(self) {
        self.library.close().expect("the binary is unloaded");
    }
}

fn beside(program: &Path, name: &str) -> PathBuf {
    let file = format!(
        "{}{name}_fmu{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let folders = program.ancestors().skip(1).take(2);
    let candidates =
        folders.flat_map(|folder| [folder.join(&file), folder.join("deps").join(&file)]);
    let found = candidates.into_iter().find(|path| path.exists());
    found.unwrap_or_else(|| panic!("{file} is not built: build the workspace"))
}
