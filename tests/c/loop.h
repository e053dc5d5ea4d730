/* Two FMUs in a closed loop, for programs that are called
 *
 *     PROGRAM LIBRARY GUID RESOURCES LIBRARY GUID RESOURCES STEP COUNT [FMU FROM TO]...
 *
 * The controller is named first, then the plant. FMU is c or p: Real output FROM of the
 * controller or the plant goes to Real input TO of the other.
 */
#ifndef LOOP_H
#define LOOP_H

#include "fmi2_host.h"

#include <inttypes.h>
#include <stdint.h>

#define MOST 256

typedef struct {
    Fmu fmu;
    void *instance;
    Fmi2Log log;
    size_t count; /* of the outputs that go to the other */
    unsigned from[MOST], to[MOST];
    double values[MOST];
} Side;

typedef struct {
    Side controller, plant;
    double size; /* of a step */
    int count;   /* of steps */
} Loop;

static void open_side(Side *side, char **argv) {
    fmi2CallbackFunctions functions = {fmi2_log, calloc, free, NULL, &side->log};
    side->count = 0;
    side->fmu = fmi2_load(argv[0]);
    side->instance = side->fmu.Instantiate("x", fmi2CoSimulation, argv[1], argv[2], &functions, 0, 0);
    if (!side->instance) {
        fprintf(stderr, "%s\n", side->log.last);
        exit(1);
    }
    CHECK(side->fmu.SetupExperiment(side->instance, 0, 0.0, 0.0, 0, 0.0) == fmi2OK);
    CHECK(side->fmu.EnterInitializationMode(side->instance) == fmi2OK);
    CHECK(side->fmu.ExitInitializationMode(side->instance) == fmi2OK);
}

static void open_loop(Loop *loop, int argc, char **argv) {
    CHECK(argc >= 9);
    open_side(&loop->controller, argv + 1);
    open_side(&loop->plant, argv + 4);
    loop->size = atof(argv[7]);
    loop->count = atoi(argv[8]);
    for (int at = 9; at + 2 < argc; at += 3) {
        Side *side = argv[at][0] == 'c' ? &loop->controller : &loop->plant;
        CHECK(side->count < MOST);
        side->from[side->count] = (unsigned)atoi(argv[at + 1]);
        side->to[side->count++] = (unsigned)atoi(argv[at + 2]);
    }
}

static void close_loop(Loop *loop) {
    loop->controller.fmu.FreeInstance(loop->controller.instance);
    loop->plant.fmu.FreeInstance(loop->plant.instance);
}

/* One side's outputs to the other; they remain in `values`. */
static void exchange(Side *from, Side *to) {
    CHECK(from->fmu.GetReal(from->instance, from->from, from->count, from->values) == fmi2OK);
    CHECK(to->fmu.SetReal(to->instance, from->to, from->count, from->values) == fmi2OK);
}

static void step_side(Side *side, double time, double size) {
    CHECK(side->fmu.DoStep(side->instance, time, size, 1) == fmi2OK);
}

/* Step number k, counted from 0, the controller first. */
static void step_loop(Loop *loop, int k) {
    exchange(&loop->plant, &loop->controller);
    step_side(&loop->controller, k * loop->size, loop->size);
    exchange(&loop->controller, &loop->plant);
    step_side(&loop->plant, k * loop->size, loop->size);
}

static uint64_t bits_of(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

#endif
