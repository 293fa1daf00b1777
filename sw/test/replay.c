/* SPDX-License-Identifier: Apache-2.0 */
/* The main function of the fuzzer without libFuzzer: runs each file of the command line once. */
#include "fuzz.h"

#include <stdio.h>

enum { INPUT_MAX = 4096 };

int main(int argc, char **argv)
{
    static uint8_t input[INPUT_MAX];
    int i;

    for (i = 1; i < argc; i++) {
        FILE *file = fopen(argv[i], "rb");

        if (!file)
            return 2;
        (void)LLVMFuzzerTestOneInput(input, fread(input, 1, sizeof input, file));
        (void)fclose(file);
    }
    return 0;
}
