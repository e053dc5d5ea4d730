/* Closes the loop of two FMUs, on whatever platform it is compiled for: see loop.h. Prints the bits
 * of every connected signal, one step a line.
 */
#include "loop.h"

static void print(const Side *side) {
    for (size_t i = 0; i < side->count; i++) {
        printf("%016" PRIx64 " ", bits_of(side->values[i]));
    }
}

int main(int argc, char **argv) {
    static Loop loop;
    open_loop(&loop, argc, argv);
    for (int k = 0; k < loop.count; k++) {
        step_loop(&loop, k);
        print(&loop.plant);
        print(&loop.controller);
        puts("");
    }
    close_loop(&loop);
    return 0;
}
