/* Lets every allocation of an FMU fail in turn:
 *
 *     memory LIBRARY GUID RESOURCES [warm]
 *
 * Instantiate, save, serialise, deserialise and refused calls are done with their k-th allocation
 * failing, and with all from the k-th on failing, for k = 0, 1, 2, ... until nothing is left to
 * fail. Each must answer with NULL or fmi2Error, leak nothing, and succeed when done once more.
 * With "warm" an instance is made first: a library that counts for tests has memory of its own
 * in each thread, which the C library cannot do without. Prints how many failures each operation met. The allocator of this program is the library's:
 * link with -rdynamic.
 */
#define _GNU_SOURCE
#include <errno.h>

#include "fmi2_host.h"

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
extern void __libc_free(void *);

/* Which allocation fails, counted from the arming on; whether all later ones do, too. */
static long failing = -1, seen;
static int ever;
static long failures, live;

static int fails(void) {
    if (failing < 0) {
        return 0;
    }
    long number = seen++;
    int now = number == failing || (ever && number > failing);
    failures += now;
    return now;
}

static void *counted(void *memory) {
    live += memory != NULL;
    return memory;
}

void *malloc(size_t size) { return fails() ? NULL : counted(__libc_malloc(size)); }

void *calloc(size_t count, size_t size) {
    return fails() ? NULL : counted(__libc_calloc(count, size));
}

void *realloc(void *memory, size_t size) {
    if (fails()) {
        return NULL;
    }
    void *moved = __libc_realloc(memory, size);
    live += moved && !memory;
    return moved;
}

void *memalign(size_t align, size_t size) {
    return fails() ? NULL : counted(__libc_memalign(align, size));
}

void *aligned_alloc(size_t align, size_t size) { return memalign(align, size); }

int posix_memalign(void **out, size_t align, size_t size) {
    void *memory = memalign(align, size);
    if (!memory) {
        return ENOMEM;
    }
    *out = memory;
    return 0;
}

void free(void *memory) {
    live -= memory != NULL;
    __libc_free(memory);
}

static Fmu fmu;
static const char *guid, *resources;
static char bytes[1 << 22];
static size_t size;
static void *c, *saved;

/* What is heard of a shortage; it allocates nothing itself. */
static int sentences;

static void hear(void *environment, const char *instance, fmi2Status status, const char *category,
                 const char *message, ...) {
    (void)environment, (void)instance, (void)category;
    sentences += status >= fmi2Error && strlen(message) > 10;
}

static const fmi2CallbackFunctions functions = {hear, NULL, NULL, NULL, NULL};

/* Each operation returns what it made, or NULL. */

static void *instantiate(void) {
    return fmu.Instantiate("x", fmi2CoSimulation, guid, resources, &functions, 0, 0);
}

static void *save(void) {
    void *state = NULL;
    fmi2Status status = fmu.GetFMUstate(c, &state);
    CHECK((status == fmi2OK) == (state != NULL) && status <= fmi2Error);
    return state;
}

static void *serialize(void) {
    size_t needed = 0;
    if (fmu.SerializedFMUstateSize(c, saved, &needed) != fmi2OK) {
        return NULL;
    }
    CHECK(needed == size);
    return fmu.SerializeFMUstate(c, saved, bytes, needed) == fmi2OK ? bytes : NULL;
}

static void *deserialize(void) {
    void *state = NULL;
    fmi2Status status = fmu.DeSerializeFMUstate(c, bytes, size, &state);
    CHECK((status == fmi2OK) == (state != NULL) && status <= fmi2Error);
    return state;
}

/* Refused by itself: only the sentence takes memory. */
static void *refused(void) {
    CHECK(fmu.DoStep(c, 0.0, -1.0, 1) == fmi2Error);
    unsigned none = 1u << 30;
    double value = 0.0;
    CHECK(fmu.GetReal(c, &none, 1, &value) == fmi2Error);
    CHECK(fmu.SetReal(c, &none, 1, &value) == fmi2Error);
    CHECK(!fmu.Instantiate("x", fmi2CoSimulation, "{0}", resources, &functions, 0, 0));
    return NULL;
}

static void *reset(void) { return fmu.Reset(c) == fmi2OK ? c : NULL; }

static void drop_instance(void *made) { fmu.FreeInstance(made); }

static void drop_state(void *made) { CHECK(fmu.FreeFMUstate(c, &made) == fmi2OK); }

static void keep(void *made) { (void)made; }

static void sweep(const char *name, void *(*operation)(void), void (*drop)(void *), int succeeds) {
    long met = 0;
    for (int all = 0; all < 2; all++) {
        for (long k = 0;; k++) {
            long before = live;
            sentences = 0;
            failing = k, ever = all, seen = 0, failures = 0;
            void *made = operation();
            failing = -1;
            met += failures > 0;
            /* A block that could not grow may have been moved: one failure need not show. */
            if (succeeds && (failures == 0 || all) && (made != NULL) != (failures == 0)) {
                fprintf(stderr, "%s, allocation %ld: %ld failures, but the result is %p\n", name, k,
                        failures, made);
                exit(1);
            }
            CHECK(made || !succeeds || sentences > 0);
            if (made) {
                drop(made);
            }
            CHECK(live == before);
            long last = failures == 0;
            made = operation();
            CHECK(!succeeds || made);
            if (made) {
                drop(made);
            }
            CHECK(live == before);
            if (last) {
                break;
            }
        }
    }
    printf("%s %ld\n", name, met);
}

int main(int argc, char **argv) {
    CHECK(argc == 4 || argc == 5);
    (void)fmi2_log; /* it formats, and this program hears without memory */
    fmu = fmi2_load(argv[1]);
    guid = argv[2], resources = argv[3];

    if (argc == 5) {
        drop_instance(instantiate());
    }
    sweep("instantiate", instantiate, drop_instance, 1);

    c = instantiate();
    CHECK(c && fmu.SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) == fmi2OK);
    CHECK(fmu.EnterInitializationMode(c) == fmi2OK && fmu.ExitInitializationMode(c) == fmi2OK);
    /* The list of saved states grows when it first holds one; then its memory remains. */
    saved = save();
    void *another = save();
    CHECK(saved && another);
    drop_state(another);
    CHECK(fmu.SerializedFMUstateSize(c, saved, &size) == fmi2OK && size <= sizeof bytes);
    CHECK(fmu.SerializeFMUstate(c, saved, bytes, size) == fmi2OK);

    sweep("save", save, drop_state, 1);
    sweep("serialize", serialize, keep, 1);
    sweep("deserialize", deserialize, drop_state, 1);
    sweep("refused", refused, keep, 0);
    sweep("reset", reset, keep, 1);
    fmu.FreeInstance(c);

    /* The list of saved states itself. */
    for (int k = 0; k < 8; k++) {
        c = instantiate();
        CHECK(c);
        long before = live;
        failing = k, ever = 1, seen = 0, failures = 0;
        void *state = save();
        failing = -1;
        CHECK((state != NULL) == (failures == 0));
        CHECK(state || live == before);
        fmu.FreeInstance(c);
    }
    CHECK(dlclose(fmu.library) == 0);
    return 0;
}
