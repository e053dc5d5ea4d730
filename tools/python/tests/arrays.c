/* A small model exchange FMU of another maker whose variables are arrays (FMI 3):
 *
 *     x' = A x + u            y = x + A u        x, u, y: 2 numbers, A: 2 by 2 */
#include <stdlib.h>
#include <string.h>
#include "fmi3Functions.h"

/* Variables by value reference, and where each one's numbers begin. */
enum { X, DX, U, Y, A, COUNT };
static const size_t begin[COUNT + 1] = {0, 2, 4, 6, 8, 12};

static void evaluate(double *v) {
    const double *x = v, *u = v + 4, *a = v + 8;
    for (int i = 0; i < 2; i++) {
        v[2 + i] = a[2 * i] * x[0] + a[2 * i + 1] * x[1] + u[i];
        v[6 + i] = x[i] + a[2 * i] * u[0] + a[2 * i + 1] * u[1];
    }
}
static fmi3Status copy(double *v, const fmi3ValueReference r[], size_t n, double *values, size_t nv, int set) {
    for (size_t i = 0, at = 0; i < n; i++) {
        size_t size = begin[r[i] + 1] - begin[r[i]];
        if (r[i] >= COUNT || at + size > nv) return fmi3Error;
        if (set) memcpy(v + begin[r[i]], values + at, size * sizeof(double));
        else memcpy(values + at, v + begin[r[i]], size * sizeof(double));
        at += size;
    }
    return fmi3OK;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String n, fmi3String t, fmi3String p, fmi3Boolean v, fmi3Boolean l, fmi3InstanceEnvironment e, fmi3LogMessageCallback m) {
    (void)n; (void)t; (void)p; (void)v; (void)l; (void)e; (void)m;
    double *model = calloc(12, sizeof(double));
    model[8] = model[11] = -1.0;
    return model;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean a, fmi3Float64 b, fmi3Float64 t, fmi3Boolean d, fmi3Float64 e) { (void)c; (void)a; (void)b; (void)t; (void)d; (void)e; return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { (void)c; return fmi3OK; }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { (void)c; return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance c) { (void)c; return fmi3OK; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *d, fmi3Boolean *e, fmi3Boolean *f, fmi3Float64 *g) { (void)c; *a = *b = *d = *e = *f = fmi3False; *g = 0; return fmi3OK; }
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[], size_t nv) { return copy(c, r, n, (double *)v, nv, 1); }
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t nv) { evaluate(c); return copy(c, r, n, v, nv, 0); }
fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) { memcpy(x, c, n * sizeof(double)); return fmi3OK; }
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) { memcpy(c, x, n * sizeof(double)); return fmi3OK; }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 x[], size_t n) { evaluate(c); memcpy(x, (double *)c + 2, n * sizeof(double)); return fmi3OK; }
