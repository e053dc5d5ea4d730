//! The macro that makes the 44 C functions.

/// Exports all functions of FMI 2.0 for a [`crate::Slave`], once in a binary, and makes
/// [`crate::memory::Memory`] its allocator.
///
/// ```text
/// fmu_abi::export_fmu!(Controller);
/// ```
///
/// The functions of model exchange are exported too, since some importers refuse a library
/// without them; they return fmi2Error.
#[macro_export]
macro_rules! export_fmu {
    ($slave:ty) => {
        const _: () = {
            #[global_allocator]
            static MEMORY: $crate::memory::Memory = $crate::memory::Memory;

            use $crate::types::*;
            use $crate::life_cycle::Function;

            #[unsafe(no_mangle)]
            extern "C" fn fmi2GetTypesPlatform() -> Text {
                $crate::exported::get_types_platform()
            }

            #[unsafe(no_mangle)]
            extern "C" fn fmi2GetVersion() -> Text {
                $crate::exported::get_version()
            }

            $crate::export_fmu! { @functions $slave;
                fmi2Instantiate = instantiate(name: Text, kind: Choice, guid: Text, resources: Text,
                    functions: *const CallbackFunctions, visible: Boolean, logging: Boolean) -> Pointer;
                fmi2FreeInstance = free_instance(c: Pointer) -> ();
                fmi2SetDebugLogging = set_debug_logging(c: Pointer, on: Boolean, n: usize,
                    categories: *const Text) -> Status;
                fmi2SetupExperiment = setup_experiment(c: Pointer, tolerance_defined: Boolean,
                    tolerance: Real, start: Real, stop_defined: Boolean, stop: Real) -> Status;
                fmi2EnterInitializationMode = enter_initialization_mode(c: Pointer) -> Status;
                fmi2ExitInitializationMode = exit_initialization_mode(c: Pointer) -> Status;
                fmi2Terminate = terminate(c: Pointer) -> Status;
                fmi2Reset = reset(c: Pointer) -> Status;
                fmi2GetReal = get_real(c: Pointer, vr: *const ValueReference, n: usize,
                    value: *mut Real) -> Status;
                fmi2GetInteger = get_integer(c: Pointer, vr: *const ValueReference, n: usize,
                    value: *mut Integer) -> Status;
                fmi2GetBoolean = get_boolean(c: Pointer, vr: *const ValueReference, n: usize,
                    value: *mut Boolean) -> Status;
                fmi2GetString = get_string(c: Pointer, vr: *const ValueReference, n: usize,
                    value: *mut Text) -> Status;
                fmi2SetReal = set_real(c: Pointer, vr: *const ValueReference, n: usize,
                    value: *const Real) -> Status;
                fmi2SetInteger = set_integer(c: Pointer, vr: *const ValueReference, n: usize,
                    value: *const Integer) -> Status;
                fmi2SetBoolean = set_boolean(c: Pointer, vr: *const ValueReference, n: usize,
                    value: *const Boolean) -> Status;
                fmi2SetString = set_string(c: Pointer, vr: *const ValueReference, n: usize,
                    value: *const Text) -> Status;
                fmi2GetFMUstate = get_fmu_state(c: Pointer, state: *mut Pointer) -> Status;
                fmi2SetFMUstate = set_fmu_state(c: Pointer, state: Pointer) -> Status;
                fmi2FreeFMUstate = free_fmu_state(c: Pointer, state: *mut Pointer) -> Status;
                fmi2SerializedFMUstateSize = serialized_fmu_state_size(c: Pointer, state: Pointer,
                    size: *mut usize) -> Status;
                fmi2SerializeFMUstate = serialize_fmu_state(c: Pointer, state: Pointer,
                    bytes: *mut Byte, size: usize) -> Status;
                fmi2DeSerializeFMUstate = deserialize_fmu_state(c: Pointer, bytes: *const Byte,
                    size: usize, state: *mut Pointer) -> Status;
                fmi2GetDirectionalDerivative = get_directional_derivative(c: Pointer,
                    unknowns: *const ValueReference, unknown_count: usize,
                    knowns: *const ValueReference, known_count: usize,
                    changes: *const Real, out: *mut Real) -> Status;
                fmi2SetRealInputDerivatives = set_real_input_derivatives(c: Pointer,
                    vr: *const ValueReference, n: usize, order: *const Integer,
                    value: *const Real) -> Status;
                fmi2GetRealOutputDerivatives = get_real_output_derivatives(c: Pointer,
                    vr: *const ValueReference, n: usize, order: *const Integer,
                    value: *mut Real) -> Status;
                fmi2DoStep = do_step(c: Pointer, point: Real, step: Real,
                    no_set_state_before_point: Boolean) -> Status;
                fmi2CancelStep = cancel_step(c: Pointer) -> Status;
                fmi2GetStatus = get_status(c: Pointer, kind: Choice, value: *mut Status) -> Status;
                fmi2GetRealStatus = get_real_status(c: Pointer, kind: Choice,
                    value: *mut Real) -> Status;
                fmi2GetIntegerStatus = get_integer_status(c: Pointer, kind: Choice,
                    value: *mut Integer) -> Status;
                fmi2GetBooleanStatus = get_boolean_status(c: Pointer, kind: Choice,
                    value: *mut Boolean) -> Status;
                fmi2GetStringStatus = get_string_status(c: Pointer, kind: Choice,
                    value: *mut Text) -> Status;
            }

            $crate::export_fmu! { @model_exchange $slave;
                fmi2EnterEventMode = EnterEventMode();
                fmi2NewDiscreteStates = NewDiscreteStates(info: *mut EventInfo);
                fmi2EnterContinuousTimeMode = EnterContinuousTimeMode();
                fmi2CompletedIntegratorStep = CompletedIntegratorStep(no_set_state: Boolean,
                    enter_event_mode: *mut Boolean, terminate: *mut Boolean);
                fmi2SetTime = SetTime(time: Real);
                fmi2SetContinuousStates = SetContinuousStates(x: *const Real, n: usize);
                fmi2GetDerivatives = GetDerivatives(derivatives: *mut Real, n: usize);
                fmi2GetEventIndicators = GetEventIndicators(indicators: *mut Real, n: usize);
                fmi2GetContinuousStates = GetContinuousStates(x: *mut Real, n: usize);
                fmi2GetNominalsOfContinuousStates = GetNominalsOfContinuousStates(
                    nominals: *mut Real, n: usize);
            }
        };
    };

    (@functions $slave:ty; $($c_name:ident = $body:ident(
        $($argument:ident: $of:ty),* $(,)?) -> $result:ty;)*) => {
        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $c_name($($argument: $of),*) -> $result {
                // SAFETY: the importer keeps the standard's contract, stated in `exported`.
                unsafe { $crate::exported::$body::<$slave>($($argument),*) }
            }
        )*
    };

    (@model_exchange $slave:ty; $($c_name:ident = $function:ident(
        $($argument:ident: $of:ty),* $(,)?);)*) => {
        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $c_name(c: Pointer $(, $argument: $of)*) -> Status {
                $(let _ = $argument;)*
                // SAFETY: the importer keeps the standard's contract, stated in `exported`.
                unsafe { $crate::exported::model_exchange::<$slave>(c, Function::$function) }
            }
        )*
    };
}
