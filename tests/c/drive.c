/* Drives an FMU as a C program does:
 *
 *     drive LIBRARY GUID RESOURCES START STEP COUNT [i VR VALUE]... [f VR VALUE]... [o VR]...
 *
 * Sets each Real input i to VALUE * (number of the step), f to VALUE, steps COUNT times, and prints the
 * bits of each Real output o after every step. On the way it saves, restores, serialises,
 * resets, uses a second instance of the same name, and unloads and loads the library again;
 * each must leave the outputs as they were.
 */
#include "fmi2_host.h"

#define MOST 64

typedef struct {
    unsigned inputs[MOST], outputs[MOST];
    double gains[MOST], fixed[MOST];
    size_t input_count, output_count;
    double start, step;
    int count;
} Plan;

static void initialize(const Fmu *fmu, void *c, const Plan *plan) {
    CHECK(fmu->SetupExperiment(c, 0, 0.0, plan->start, 0, 0.0) == fmi2OK);
    CHECK(fmu->EnterInitializationMode(c) == fmi2OK);
    CHECK(fmu->ExitInitializationMode(c) == fmi2OK);
}

/* Step number k, counted from 0; the outputs go to `out`. */
static void step(const Fmu *fmu, void *c, const Plan *plan, int k, double *out) {
    double values[MOST];
    for (size_t i = 0; i < plan->input_count; i++) {
        values[i] = plan->fixed[i] + plan->gains[i] * (k + 1);
    }
    CHECK(fmu->SetReal(c, plan->inputs, plan->input_count, values) == fmi2OK);
    CHECK(fmu->DoStep(c, plan->start + k * plan->step, plan->step, 1) == fmi2OK);
    CHECK(fmu->GetReal(c, plan->outputs, plan->output_count, out) == fmi2OK);
}

static void same(const Plan *plan, const double *a, const double *b) {
    CHECK(memcmp(a, b, plan->output_count * sizeof *a) == 0);
}

/* Goes to another state and back through bytes, and does step k twice. */
static void rollback(const Fmu *fmu, void *c, const Plan *plan, int k, const double *expected) {
    void *saved = NULL, *copy = NULL;
    size_t size = 0;
    double out[MOST];
    CHECK(fmu->GetFMUstate(c, &saved) == fmi2OK);
    step(fmu, c, plan, k, out);
    same(plan, out, expected);
    CHECK(fmu->SerializedFMUstateSize(c, saved, &size) == fmi2OK);
    char *bytes = malloc(size);
    CHECK(bytes && fmu->SerializeFMUstate(c, saved, bytes, size) == fmi2OK);
    CHECK(fmu->DeSerializeFMUstate(c, bytes, size, &copy) == fmi2OK);
    bytes[size / 2] ^= 1;
    void *damaged = NULL;
    CHECK(fmu->DeSerializeFMUstate(c, bytes, size, &damaged) == fmi2Error && !damaged);
    free(bytes);
    CHECK(fmu->SetFMUstate(c, copy) == fmi2OK);
    step(fmu, c, plan, k, out);
    same(plan, out, expected);
    CHECK(fmu->SetFMUstate(c, saved) == fmi2OK);
    CHECK(fmu->FreeFMUstate(c, &saved) == fmi2OK && !saved);
    /* The other copy is left to fmi2FreeInstance. */
}

int main(int argc, char **argv) {
    CHECK(argc >= 7);
    Plan plan = {.start = atof(argv[4]), .step = atof(argv[5]), .count = atoi(argv[6])};
    for (int at = 7; at + 1 < argc; at += 2) {
        CHECK(plan.input_count < MOST && plan.output_count < MOST);
        if (argv[at][0] != 'o') {
            CHECK(at + 2 < argc);
            plan.inputs[plan.input_count] = (unsigned)atoi(argv[at + 1]);
            double *value = argv[at][0] == 'f' ? plan.fixed : plan.gains;
            value[plan.input_count++] = atof(argv[at + 2]);
            at++;
        } else {
            plan.outputs[plan.output_count++] = (unsigned)atoi(argv[at + 1]);
        }
    }

    for (int life = 0; life < 2; life++) {
        Fmu fmu = fmi2_load(argv[1]);
        CHECK(strcmp(fmu.GetVersion(), "2.0") == 0);
        CHECK(strcmp(fmu.GetTypesPlatform(), "default") == 0);
        Fmi2Log log = {0};
        fmi2CallbackFunctions functions = {fmi2_log, calloc, free, NULL, &log};
        fmi2CallbackFunctions silent = {NULL, NULL, NULL, NULL, NULL};

        CHECK(!fmu.Instantiate("x", fmi2CoSimulation, "{0}", argv[3], &functions, 0, 0));
        CHECK(log.count == 1 && strlen(log.last) > 20);
        CHECK(!fmu.Instantiate("x", fmi2CoSimulation, argv[2], "file:///none", &silent, 0, 1));
        CHECK(!fmu.Instantiate("x", fmi2ModelExchange, argv[2], argv[3], &silent, 0, 1));

        /* The struct of callbacks need not outlive the call. */
        fmi2CallbackFunctions *brief = malloc(sizeof *brief);
        CHECK(brief);
        *brief = functions;
        void *c = fmu.Instantiate("x", fmi2CoSimulation, argv[2], argv[3], brief, 0, 1);
        memset(brief, 0xff, sizeof *brief);
        free(brief);
        void *twin = fmu.Instantiate("x", fmi2CoSimulation, argv[2], argv[3], &silent, 0, 0);
        CHECK(c && twin && c != twin);

        initialize(&fmu, c, &plan);
        initialize(&fmu, twin, &plan);
        double(*history)[MOST] = calloc((size_t)plan.count, sizeof *history);
        CHECK(history);
        for (int k = 0; k < plan.count; k++) {
            step(&fmu, twin, &plan, k, history[k]);
        }
        for (int k = 0; k < plan.count; k++) {
            double out[MOST], time;
            if (k == plan.count / 2) {
                rollback(&fmu, c, &plan, k, history[k]);
            }
            step(&fmu, c, &plan, k, out);
            same(&plan, out, history[k]);
            CHECK(fmu.GetRealStatus(c, fmi2LastSuccessfulTime, &time) == fmi2OK);
            CHECK(time == plan.start + k * plan.step + plan.step);
            for (size_t i = 0; life == 0 && i < plan.output_count; i++) {
                printf("%a%c", out[i], i + 1 < plan.output_count ? ' ' : '\n');
            }
        }

        int before = log.count;
        CHECK(fmu.SetTime(c, 0.0) == fmi2Error && log.count == before + 1);
        const char *all[] = {"logAll"};
        CHECK(fmu.SetDebugLogging(c, 0, 1, all) == fmi2OK);
        /* What was refused is heard with every category off. */
        CHECK(fmu.DoStep(c, 1e9, -1.0, 1) == fmi2Error && log.count == before + 2);
        CHECK(fmu.Terminate(c) == fmi2OK && fmu.Reset(c) == fmi2OK);
        initialize(&fmu, c, &plan);
        for (int k = 0; k < plan.count; k++) {
            double out[MOST];
            step(&fmu, c, &plan, k, out);
            same(&plan, out, history[k]);
        }
        free(history);
        fmu.FreeInstance(twin);
        fmu.FreeInstance(c);
        fmu.FreeInstance(NULL);
        CHECK(dlclose(fmu.library) == 0);
    }
    return 0;
}
