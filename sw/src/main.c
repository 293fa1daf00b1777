/* SPDX-License-Identifier: Apache-2.0 */
#include "gateway.h"

int main(void)
{
    static struct gateway gateway;

    gateway_init(&gateway);
    for (;;)
        gateway_poll(&gateway);
}
