/* The least an FMU can do, for comparison: eight Real inputs 0..7 appear at the outputs 8..15 when a
 * step is done. It checks its arguments and its state as a careful FMU does, and nothing more.
 */
#include <stdlib.h>
#include <string.h>

enum { OK, Error = 3 };
enum { Instantiated, Initializing, Ready };
enum { WIDTH = 8 };

typedef struct {
    int phase;
    double time, inputs[WIDTH], outputs[WIDTH];
} Instance;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                      const void *functions, int visible, int logging) {
    (void)resources, (void)visible, (void)logging;
    if (!name || kind != 1 || !guid || !functions) {
        return NULL;
    }
    return calloc(1, sizeof(Instance));
}

void fmi2FreeInstance(void *c) { free(c); }

int fmi2SetupExperiment(void *c, int defined, double tolerance, double start, int stops, double stop) {
    (void)defined, (void)tolerance, (void)stops, (void)stop;
    Instance *it = c;
    if (!it || it->phase != Instantiated) {
        return Error;
    }
    it->time = start;
    return OK;
}

int fmi2EnterInitializationMode(void *c) {
    Instance *it = c;
    if (!it || it->phase != Instantiated) {
        return Error;
    }
    it->phase = Initializing;
    return OK;
}

int fmi2ExitInitializationMode(void *c) {
    Instance *it = c;
    if (!it || it->phase != Initializing) {
        return Error;
    }
    it->phase = Ready;
    return OK;
}

int fmi2SetReal(void *c, const unsigned references[], size_t count, const double values[]) {
    Instance *it = c;
    if (!it || (count && (!references || !values))) {
        return Error;
    }
    for (size_t at = 0; at < count; at++) {
        if (references[at] >= WIDTH) {
            return Error;
        }
        it->inputs[references[at]] = values[at];
    }
    return OK;
}

int fmi2GetReal(void *c, const unsigned references[], size_t count, double values[]) {
    Instance *it = c;
    if (!it || (count && (!references || !values))) {
        return Error;
    }
    for (size_t at = 0; at < count; at++) {
        if (references[at] >= 2 * WIDTH) {
            return Error;
        }
        int output = references[at] >= WIDTH;
        values[at] = output ? it->outputs[references[at] - WIDTH] : it->inputs[references[at]];
    }
    return OK;
}

int fmi2DoStep(void *c, double from, double step, int discard) {
    (void)discard;
    Instance *it = c;
    if (!it || it->phase != Ready || !(step > 0.0)) {
        return Error;
    }
    it->time = from + step;
    memcpy(it->outputs, it->inputs, sizeof it->outputs);
    return OK;
}
