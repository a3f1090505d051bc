/* SPDX-License-Identifier: Apache-2.0 */
/* Plays messages from memory to the hardware, and writes the responses to the console: the program of `firm emulate`,
 * and an example of a node without Linux.
 *
 * In memory: the number of messages, then for each message its subscriber, its size, and its payload, which is padded to
 * four bytes. All numbers have 32 bits. On the console: `frame` and the bytes of each received frame, and `counts` when
 * the counts have changed and the link is silent. */
#ifndef FIRM_PLAYER_H
#define FIRM_PLAYER_H

#include "firm_config.h"

#ifndef FIRM_PLAYER_MESSAGES
#define FIRM_PLAYER_MESSAGES 0x10000000u /* the address of the messages */
#endif

/* Open the link. */
void firm_player_open(void);

/* Queue the next message, if all earlier ones are sent. Returns 0 if it did nothing. */
int firm_player_put(void);

/* Send the queued messages, receive, and report. Returns 0 if it did nothing. */
int firm_player_carry(void);

#endif
