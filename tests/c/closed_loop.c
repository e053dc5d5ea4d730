/* Closes the loop of two FMUs, on whatever platform it is compiled for:
 *
 *     closed_loop LIBRARY GUID RESOURCES LIBRARY GUID RESOURCES STEP COUNT [FMU FROM TO]...
 *
 * The controller is named first, then the plant. FMU is c or p: Real output FROM of the
 * controller or the plant goes to Real input TO of the other. The controller steps first. Prints
 * the bits of every connected signal, one step a line.
 */
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

static void exchange(Side *from, Side *to) {
    CHECK(from->fmu.GetReal(from->instance, from->from, from->count, from->values) == fmi2OK);
    CHECK(to->fmu.SetReal(to->instance, from->to, from->count, from->values) == fmi2OK);
    for (size_t i = 0; i < from->count; i++) {
        uint64_t bits;
        memcpy(&bits, &from->values[i], sizeof bits);
        printf("%016" PRIx64 " ", bits);
    }
}

static void step(Side *side, double time, double size) {
    CHECK(side->fmu.DoStep(side->instance, time, size, 1) == fmi2OK);
}

int main(int argc, char **argv) {
    static Side controller, plant;
    CHECK(argc >= 9);
    open_side(&controller, argv + 1);
    open_side(&plant, argv + 4);
    double size = atof(argv[7]);
    int count = atoi(argv[8]);
    for (int at = 9; at + 2 < argc; at += 3) {
        Side *side = argv[at][0] == 'c' ? &controller : &plant;
        CHECK(side->count < MOST);
        side->from[side->count] = (unsigned)atoi(argv[at + 1]);
        side->to[side->count++] = (unsigned)atoi(argv[at + 2]);
    }
    for (int k = 0; k < count; k++) {
        exchange(&plant, &controller);
        step(&controller, k * size, size);
        exchange(&controller, &plant);
        step(&plant, k * size, size);
        puts("");
    }
    controller.fmu.FreeInstance(controller.instance);
    plant.fmu.FreeInstance(plant.instance);
    return 0;
}
