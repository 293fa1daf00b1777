/* SPDX-License-Identifier: Apache-2.0 */
/* Generated from VERSION by `make regs`; edit that file, not this one. */

#ifndef VERSION_H
#define VERSION_H

#define CARD_VERSION "0.2.0"

#endif
