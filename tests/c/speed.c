/* Measures an FMU as a C program uses it:
 *
 *     speed LIBRARY GUID RESOURCES STEP FILE COUNT REPEATS INSTANCES [i VR]... [o VR]...
 *
 * FILE holds COUNT rows of doubles, one for each Real input i. Each repeat makes an instance and
 * takes COUNT steps: sets all inputs, steps, gets all Real outputs o. Prints microseconds to
 * instantiate (the median of INSTANCES; 0 if there are none) and nanoseconds a step (the least of
 * the repeats), and a sum of the last outputs, so that nothing is computed in vain.
 */
#define FMI2_CALLED_ONLY
#include "fmi2_host.h"
#include <time.h>

#define MOST 256

static unsigned inputs[MOST], outputs[MOST];
static size_t input_count, output_count;

static double now(void) {
    struct timespec time;
    CHECK(clock_gettime(CLOCK_MONOTONIC, &time) == 0);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static int ascending(const void *a, const void *b) {
    double left = *(const double *)a, right = *(const double *)b;
    return (left > right) - (left < right);
}

static double instantiate(const Fmu *fmu, char **argv, const fmi2CallbackFunctions *functions,
                          int count) {
    double *times = calloc((size_t)count + 1, sizeof *times);
    CHECK(times);
    for (int k = 0; k < count; k++) {
        double begun = now();
        void *c = fmu->Instantiate("x", fmi2CoSimulation, argv[2], argv[3], functions, 0, 0);
        times[k] = now() - begun;
        CHECK(c);
        fmu->FreeInstance(c);
    }
    qsort(times, (size_t)count, sizeof *times, ascending);
    double median = times[count / 2];
    free(times);
    return 1e6 * median;
}

int main(int argc, char **argv) {
    CHECK(argc >= 9);
    double step = atof(argv[4]);
    int count = atoi(argv[6]), repeats = atoi(argv[7]);
    CHECK(count > 0 && repeats > 0);
    for (int at = 9; at + 1 < argc; at += 2) {
        CHECK(input_count < MOST && output_count < MOST);
        unsigned reference = (unsigned)atoi(argv[at + 1]);
        if (argv[at][0] == 'i') {
            inputs[input_count++] = reference;
        } else {
            outputs[output_count++] = reference;
        }
    }
    size_t size = (size_t)count * input_count;
    double *rows = malloc((size + 1) * sizeof *rows), out[MOST] = {0}, least = 1e9, sum = 0.0;
    FILE *file = fopen(argv[5], "rb");
    CHECK(rows && file && fread(rows, sizeof *rows, size, file) == size);
    fclose(file);

    Fmu fmu = fmi2_load(argv[1]);
    Fmi2Log log = {0};
    fmi2CallbackFunctions functions = {fmi2_log, calloc, free, NULL, &log};
    double made = instantiate(&fmu, argv, &functions, atoi(argv[8]));
    for (int repeat = 0; repeat < repeats; repeat++) {
        void *c = fmu.Instantiate("x", fmi2CoSimulation, argv[2], argv[3], &functions, 0, 0);
        CHECK(c && fmu.SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) == fmi2OK);
        CHECK(fmu.EnterInitializationMode(c) == fmi2OK);
        CHECK(fmu.SetReal(c, inputs, input_count, rows) == fmi2OK);
        CHECK(fmu.ExitInitializationMode(c) == fmi2OK);
        double begun = now();
        for (int k = 0; k < count; k++) {
            int status = fmu.SetReal(c, inputs, input_count, rows + (size_t)k * input_count);
            status |= fmu.DoStep(c, k * step, step, 1);
            status |= fmu.GetReal(c, outputs, output_count, out);
            CHECK(status == fmi2OK);
        }
        double each = 1e9 * (now() - begun) / count;
        least = each < least ? each : least;
        fmu.FreeInstance(c);
    }
    for (size_t at = 0; at < output_count; at++) {
        sum += out[at];
    }
    printf("%.3f %.2f %a\n", made, least, sum);
    free(rows);
    return 0;
}
