/* A small model exchange FMU of another maker, as far as linearising it needs one:
 *
 *     x1' = x2 + 0.2 w        y = x1 + 0.1 x2^2 + 0.05 w
 *     x2' = mu (1 - x1^2) x2 - x1^3 + u
 *
 * FMI 2 or 3 by -DFMI=2 or 3; with -DDERIVATIVES it gives directional derivatives, with
 * -DFORGETFUL those of the output are 0. */
#include <stdlib.h>
#if FMI == 2
#include "fmi2Functions.h"
typedef fmi2Component Handle;
typedef fmi2ValueReference Reference;
typedef fmi2Real Real;
typedef fmi2Status Status;
#define OK fmi2OK
#else
#include "fmi3Functions.h"
typedef fmi3Instance Handle;
typedef fmi3ValueReference Reference;
typedef fmi3Float64 Real;
typedef fmi3Status Status;
#define OK fmi3OK
#endif

/* By value reference: x1, x2, their derivatives, u, w, y, mu. */
enum { X1, X2, DX1, DX2, U, W, Y, MU, COUNT };
typedef struct { Real v[COUNT]; } Model;

static void evaluate(Model *m) {
    Real *v = m->v;
    v[DX1] = v[X2] + 0.2 * v[W];
    v[DX2] = v[MU] * (1 - v[X1] * v[X1]) * v[X2] - v[X1] * v[X1] * v[X1] + v[U];
    v[Y] = v[X1] + 0.1 * v[X2] * v[X2] + 0.05 * v[W];
}
static Model *make(void) {
    Model *m = calloc(1, sizeof(Model));
    m->v[X1] = 0.5; m->v[MU] = 1.0;
    return m;
}
static Status set(Handle c, const Reference *r, size_t n, const Real *values) {
    for (size_t i = 0; i < n; i++) ((Model *)c)->v[r[i]] = values[i];
    return OK;
}
static Status get(Handle c, const Reference *r, size_t n, Real *values) {
    evaluate(c);
    for (size_t i = 0; i < n; i++) values[i] = ((Model *)c)->v[r[i]];
    return OK;
}
static Status states(Handle c, Real *x) { x[0] = ((Model *)c)->v[X1]; x[1] = ((Model *)c)->v[X2]; return OK; }
static Status set_states(Handle c, const Real *x) { ((Model *)c)->v[X1] = x[0]; ((Model *)c)->v[X2] = x[1]; return OK; }
static Status derivatives(Handle c, Real *dx) { evaluate(c); dx[0] = ((Model *)c)->v[DX1]; dx[1] = ((Model *)c)->v[DX2]; return OK; }
#ifdef DERIVATIVES
static Status directional(Handle c, const Reference *unknown, size_t nu, const Reference *known, size_t nk,
                          const Real *seed, Real *out) {
    Real *v = ((Model *)c)->v, s[COUNT] = {0};
    for (size_t i = 0; i < nk; i++) s[known[i]] = seed[i];
    Real r[COUNT] = {0};
    r[DX1] = s[X2] + 0.2 * s[W];
    r[DX2] = (-2 * v[MU] * v[X1] * v[X2] - 3 * v[X1] * v[X1]) * s[X1] + v[MU] * (1 - v[X1] * v[X1]) * s[X2] + s[U];
#ifndef FORGETFUL
    r[Y] = s[X1] + 0.2 * v[X2] * s[X2] + 0.05 * s[W];
#endif
    for (size_t i = 0; i < nu; i++) out[i] = r[unknown[i]];
    return OK;
}
#endif

#if FMI == 2
fmi2Component fmi2Instantiate(fmi2String n, fmi2Type t, fmi2String g, fmi2String l, const fmi2CallbackFunctions *f, fmi2Boolean v, fmi2Boolean d) { (void)n; (void)t; (void)g; (void)l; (void)f; (void)v; (void)d; return make(); }
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real t, fmi2Boolean d, fmi2Real e) { (void)c; (void)a; (void)b; (void)t; (void)d; (void)e; return OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { (void)c; return OK; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { (void)c; return OK; }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *e) { (void)c; e->newDiscreteStatesNeeded = fmi2False; e->terminateSimulation = fmi2False; e->nominalsOfContinuousStatesChanged = fmi2False; e->valuesOfContinuousStatesChanged = fmi2False; e->nextEventTimeDefined = fmi2False; return OK; }
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[]) { return set(c, r, n, v); }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) { return get(c, r, n, v); }
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { (void)n; return states(c, x); }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) { (void)n; return set_states(c, x); }
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real x[], size_t n) { (void)n; return derivatives(c, x); }
#ifdef DERIVATIVES
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[], size_t nk, const fmi2Real s[], fmi2Real o[]) { return directional(c, u, nu, k, nk, s, o); }
#endif
#else
fmi3Instance fmi3InstantiateModelExchange(fmi3String n, fmi3String t, fmi3String p, fmi3Boolean v, fmi3Boolean l, fmi3InstanceEnvironment e, fmi3LogMessageCallback m) { (void)n; (void)t; (void)p; (void)v; (void)l; (void)e; (void)m; return make(); }
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 t, fmi3Boolean d, fmi3Float64 e) { (void)c; (void)a; (void)b; (void)t; (void)d; (void)e; return OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { (void)c; return OK; }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { (void)c; return OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { (void)c; return OK; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e, fmi3Boolean *f, fmi3Float64 *g) { (void)c; *a = *b = *d = *e = *f = fmi3False; *g = 0; return OK; }
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[], size_t nv) { (void)nv; return set(c, r, n, v); }
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t nv) { (void)nv; return get(c, r, n, v); }
fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) { (void)n; return states(c, x); }
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) { (void)n; return set_states(c, x); }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 x[], size_t n) { (void)n; return derivatives(c, x); }
#ifdef DERIVATIVES
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference u[], size_t nu, const fmi3ValueReference k[], size_t nk, const fmi3Float64 s[], size_t ns, fmi3Float64 o[], size_t no) { (void)ns; (void)no; return directional(c, u, nu, k, nk, s, o); }
#endif
#endif
