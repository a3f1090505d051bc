/* SPDX-License-Identifier: Apache-2.0 */
/* The status of hardware, read and written by frames of the status id (docs/reference/status.md). C99.
 *
 *     firm_status_read_request(request, FIRM_STATUS_CHANNEL(0) + FIRM_STATUS_FAULTS(FIRM_FAULT_SHORT_FRAME));
 *     ... send the request; for each received frame:
 *     if (firm_status_answer(frame, size, &address, &word)) ...
 *
 * A decoder that is to receive answers is prepared for 256 publishers, since the status id is above those of all
 * publishers. With AXI4-Lite instead of frames, the same addresses are offsets for firm_read and firm_write. */
#ifndef FIRM_STATUS_H
#define FIRM_STATUS_H

#include "firm_frame.h"

#define FIRM_STATUS_ID 255u
#define FIRM_STATUS_FRAME_BYTES 13u
#define FIRM_STATUS_WIDE_FRAME_BYTES 14u /* with ids of two bytes */

/* Addresses of registers. */
#define FIRM_STATUS_MAGIC 0x00u /* holds FIRM_STATUS_MARK */
#define FIRM_STATUS_SHAPE 0x04u /* subscribers (bits 11 to 0), publishers (23 to 12), version of the map (31 to 24) */
#define FIRM_STATUS_CONTROL 0x08u
#define FIRM_STATUS_INTERRUPT 0x0Cu
#define FIRM_STATUS_INTERRUPT_ENABLE 0x10u
#define FIRM_STATUS_LAST_FAULT 0x14u /* code (bits 3 to 0), channel (15 to 4) */
#define FIRM_STATUS_ID_ERRORS 0x18u
#define FIRM_STATUS_LINK_ERRORS 0x1Cu
#define FIRM_STATUS_LOST 0x20u
#define FIRM_STATUS_CYCLES 0x24u   /* with time stamps: cycles since reset, modulo 2^32 */
#define FIRM_STATUS_FEATURES 0x28u /* bit 0: time stamps */
#define FIRM_STATUS_DIGEST(word) (0x30u + 4u * (word)) /* words 0 to 3, the lowest one first */
#define FIRM_STATUS_MARK 0x4D524946u

/* The parameters of accelerators (docs/reference/parameters.md): the word that software wants, and the one in effect.
 * `firm registers` writes their numbers, and those of all registers, into a header. */
#define FIRM_STATUS_PARAMETER_WANTED(number) (0x100u + 8u * (number))
#define FIRM_STATUS_PARAMETER(number) (0x104u + 8u * (number))

/* The first address of a channel: subscribers by id, then publishers by id. Its registers follow. */
#define FIRM_STATUS_CHANNEL(channel) (0x8000u + 0x40u * (channel))
#define FIRM_STATUS_SIGNATURE 0x00u
#define FIRM_STATUS_FAULTS(code) (4u * (code)) /* code of firm_fault_t */
#define FIRM_STATUS_FRAMES 0x34u
#define FIRM_STATUS_LONGEST_WAIT 0x38u /* cycles */
/* With time stamps: FIRM_STATUS_CYCLES one cycle after the first beat of a subscriber's newest frame, or after the last
 * beat of a publisher's. The difference of two stamps as uint32_t is a time in cycles. */
#define FIRM_STATUS_STAMP 0x3Cu

/* Write the frame that reads or writes the register at an address. */
void firm_status_read_request(uint8_t request[FIRM_STATUS_FRAME_BYTES], uint32_t address);
void firm_status_write_request(uint8_t request[FIRM_STATUS_FRAME_BYTES], uint32_t address, uint32_t word);

/* Return whether a frame is an answer; then `word` is the word of the register at `address` before the access. */
int firm_status_answer(const uint8_t *frame, size_t size, uint32_t *address, uint32_t *word);

/* The same for systems with ids of two bytes ('idBytes: 2'). */
void firm_status_wide_read_request(uint8_t request[FIRM_STATUS_WIDE_FRAME_BYTES], uint32_t address);
void firm_status_wide_write_request(uint8_t request[FIRM_STATUS_WIDE_FRAME_BYTES], uint32_t address, uint32_t word);
int firm_status_wide_answer(const uint8_t *frame, size_t size, uint32_t *address, uint32_t *word);

#endif
