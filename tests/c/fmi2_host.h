/* A host for FMI 2.0 co-simulation FMUs in one header, for tests.
 *
 * It declares what it needs of the standard, loads a library at run time, and fails loudly:
 * every check that does not hold prints where and ends the program with code 1.
 */
#ifndef FMI2_HOST_H
#define FMI2_HOST_H

#ifdef _WIN32
#include <windows.h>
#define dlopen(path, flags) ((void *)LoadLibraryA(path))
#define dlsym(library, name) ((void *)(size_t)GetProcAddress((HMODULE)(library), name))
#define dlclose(library) (!FreeLibrary((HMODULE)(library)))
#define dlerror() "the library cannot be loaded"
#else
#include <dlfcn.h>
#endif
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(condition)                                                              \
    do {                                                                              \
        if (!(condition)) {                                                           \
            fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #condition); \
            exit(1);                                                                  \
        }                                                                             \
    } while (0)

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
enum { fmi2ModelExchange, fmi2CoSimulation };
enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated };

typedef struct {
    void (*logger)(void *, const char *, fmi2Status, const char *, const char *, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, fmi2Status);
    void *componentEnvironment;
} fmi2CallbackFunctions;

/* name, result, arguments: the functions that a loop needs */
#define FMI2_LOOP(X)                                                                            \
    X(GetTypesPlatform, const char *, (void))                                                   \
    X(GetVersion, const char *, (void))                                                         \
    X(Instantiate, void *, (const char *, int, const char *, const char *,                      \
                            const fmi2CallbackFunctions *, int, int))                           \
    X(FreeInstance, void, (void *))                                                             \
    X(SetupExperiment, fmi2Status, (void *, int, double, double, int, double))                  \
    X(EnterInitializationMode, fmi2Status, (void *))                                            \
    X(ExitInitializationMode, fmi2Status, (void *))                                             \
    X(GetReal, fmi2Status, (void *, const unsigned[], size_t, double[]))                        \
    X(SetReal, fmi2Status, (void *, const unsigned[], size_t, const double[]))                  \
    X(DoStep, fmi2Status, (void *, double, double, int))

/* the others that the host calls */
#define FMI2_MORE(X)                                                                            \
    X(SetDebugLogging, fmi2Status, (void *, int, size_t, const char *const[]))                  \
    X(Terminate, fmi2Status, (void *))                                                          \
    X(Reset, fmi2Status, (void *))                                                              \
    X(GetFMUstate, fmi2Status, (void *, void **))                                               \
    X(SetFMUstate, fmi2Status, (void *, void *))                                                \
    X(FreeFMUstate, fmi2Status, (void *, void **))                                              \
    X(SerializedFMUstateSize, fmi2Status, (void *, void *, size_t *))                           \
    X(SerializeFMUstate, fmi2Status, (void *, void *, char[], size_t))                          \
    X(DeSerializeFMUstate, fmi2Status, (void *, const char[], size_t, void **))                 \
    X(GetRealStatus, fmi2Status, (void *, int, double *))                                       \
    X(SetTime, fmi2Status, (void *, double))

#ifdef FMI2_CALLED_ONLY
#define FMI2_CALLED(X) FMI2_LOOP(X)
#else
#define FMI2_CALLED(X) FMI2_LOOP(X) FMI2_MORE(X)
#endif

/* the other functions of the standard, which must be there too */
#define FMI2_PRESENT(X)                                                                         \
    X(GetInteger) X(GetBoolean) X(GetString) X(SetInteger) X(SetBoolean) X(SetString)           \
    X(GetDirectionalDerivative) X(SetRealInputDerivatives) X(GetRealOutputDerivatives)          \
    X(CancelStep) X(GetStatus) X(GetIntegerStatus) X(GetBooleanStatus) X(GetStringStatus)       \
    X(EnterEventMode) X(NewDiscreteStates) X(EnterContinuousTimeMode)                           \
    X(CompletedIntegratorStep) X(SetContinuousStates) X(GetDerivatives) X(GetEventIndicators)   \
    X(GetContinuousStates) X(GetNominalsOfContinuousStates)

typedef struct {
    void *library;
#define FMI2_FIELD(name, result, arguments) result(*name) arguments;
    FMI2_CALLED(FMI2_FIELD)
#undef FMI2_FIELD
} Fmu;

static void *fmi2_symbol(void *library, const char *name) {
    void *symbol = dlsym(library, name);
    if (!symbol) {
        fprintf(stderr, "the library has no function %s\n", name);
        exit(1);
    }
    return symbol;
}

/* Loads a library and all 44 functions; with FMI2_CALLED_ONLY defined, those that a loop needs. */
static Fmu fmi2_load(const char *path) {
    Fmu fmu;
    fmu.library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!fmu.library) {
        fprintf(stderr, "%s\n", dlerror());
        exit(1);
    }
    void *symbol;
#define FMI2_LOAD(name, result, arguments)             \
    symbol = fmi2_symbol(fmu.library, "fmi2" #name); \
    memcpy(&fmu.name, &symbol, sizeof symbol);
    FMI2_CALLED(FMI2_LOAD)
#undef FMI2_LOAD
#ifndef FMI2_CALLED_ONLY
#define FMI2_FIND(name) fmi2_symbol(fmu.library, "fmi2" #name);
    FMI2_PRESENT(FMI2_FIND)
#undef FMI2_FIND
#endif
    return fmu;
}

/* What the logger received; it formats as printf does, as most importers do. */
typedef struct {
    int count;
    char last[1024];
} Fmi2Log;

static void fmi2_log(void *environment, const char *instance, fmi2Status status,
                     const char *category, const char *message, ...) {
    CHECK(environment && instance && category && message);
    CHECK(status <= fmi2Fatal);
    Fmi2Log *log = environment;
    va_list arguments;
    va_start(arguments, message);
    vsnprintf(log->last, sizeof log->last, message, arguments);
    va_end(arguments);
    log->count++;
}

#endif
