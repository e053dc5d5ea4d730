/* Closes the loop of two FMUs in eight threads at once, two loops in each, their steps
 * interleaved: see loop.h for how it is called. On the way states are saved and restored. Every
 * loop must give the bits of those that run first, by themselves.
 *
 * It is meant to be run under a checker of threads. What Rust's standard library finds out about
 * the system once is kept in atomics, which such a checker takes for plain memory; the first
 * loops have done that before there is a second thread.
 */
#include "loop.h"

#include <pthread.h>

#define THREADS 8
#define LOOPS 2

typedef struct {
    int argc;
    char **argv;
    uint64_t hash[LOOPS];
} Work;

/* Folds a side's outputs into a hash. */
static uint64_t fold(uint64_t hash, const Side *side) {
    for (size_t i = 0; i < side->count; i++) {
        hash = (hash ^ bits_of(side->values[i])) * UINT64_C(0x100000001b3);
    }
    return hash;
}

/* Goes to the present state and back through bytes. */
static void there_and_back(Side *side) {
    void *saved = NULL, *copy = NULL;
    size_t size = 0;
    CHECK(side->fmu.GetFMUstate(side->instance, &saved) == fmi2OK);
    CHECK(side->fmu.SerializedFMUstateSize(side->instance, saved, &size) == fmi2OK);
    char *bytes = malloc(size);
    CHECK(bytes && side->fmu.SerializeFMUstate(side->instance, saved, bytes, size) == fmi2OK);
    CHECK(side->fmu.DeSerializeFMUstate(side->instance, bytes, size, &copy) == fmi2OK);
    free(bytes);
    CHECK(side->fmu.SetFMUstate(side->instance, copy) == fmi2OK);
    CHECK(side->fmu.FreeFMUstate(side->instance, &copy) == fmi2OK);
    CHECK(side->fmu.FreeFMUstate(side->instance, &saved) == fmi2OK);
}

static void *work(void *of) {
    Work *it = of;
    Loop *loops = calloc(LOOPS, sizeof *loops);
    CHECK(loops);
    for (int i = 0; i < LOOPS; i++) {
        open_loop(&loops[i], it->argc, it->argv);
    }
    for (int k = 0; k < loops[0].count; k++) {
        for (int i = 0; i < LOOPS; i++) {
            step_loop(&loops[i], k);
            it->hash[i] = fold(fold(it->hash[i], &loops[i].plant), &loops[i].controller);
            if (k % 10 == i) {
                there_and_back(&loops[i].controller);
                there_and_back(&loops[i].plant);
            }
        }
    }
    for (int i = 0; i < LOOPS; i++) {
        close_loop(&loops[i]);
    }
    free(loops);
    return NULL;
}

int main(int argc, char **argv) {
    pthread_t threads[THREADS];
    Work first = {.argc = argc, .argv = argv}, works[THREADS] = {{0}};
    work(&first);
    CHECK(first.hash[0] != 0 && first.hash[0] == first.hash[1]);
    for (int t = 0; t < THREADS; t++) {
        works[t].argc = argc;
        works[t].argv = argv;
        CHECK(pthread_create(&threads[t], NULL, work, &works[t]) == 0);
    }
    for (int t = 0; t < THREADS; t++) {
        CHECK(pthread_join(threads[t], NULL) == 0);
    }
    for (int t = 0; t < THREADS; t++) {
        for (int i = 0; i < LOOPS; i++) {
            CHECK(works[t].hash[i] == first.hash[0]);
        }
    }
    printf("%d threads, %016" PRIx64 "\n", THREADS, first.hash[0]);
    return 0;
}
