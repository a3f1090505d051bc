/* SPDX-License-Identifier: Apache-2.0 */
/* The faults of frames: the codes that converters, the Manager and links report in frame_error_code. 0 is not a fault. */
/* `make constants` writes the codes and texts from fusesoc_firm/frame/faults.py. */
#ifndef FIRM_FAULTS_H
#define FIRM_FAULTS_H

typedef enum {
    FIRM_FAULT_BAD_LENGTH = 1,
    FIRM_FAULT_SHORT_FRAME = 2,
    FIRM_FAULT_LONG_FRAME = 3,
    FIRM_FAULT_BAD_ENCODING = 4,
    FIRM_FAULT_BAD_COUNT = 5,
    FIRM_FAULT_OVER_BUFFER = 6,
    FIRM_FAULT_TOO_LONG = 7,
    FIRM_FAULT_BROKEN_BEAT = 8,
    FIRM_FAULT_WATCHDOG = 9,
    FIRM_FAULT_ABORTED = 10,
    FIRM_FAULT_DROPPED = 11,
    FIRM_FAULT_BAD_CHECKSUM = 12
} firm_fault_t;

/* The text of each code. */
static const char *const firm_fault_texts[] = {
    "no fault",
    "the length is not that of the message",
    "the frame or a part of it ended early",
    "the frame or a part of it continued after its length",
    "the encoding is unknown",
    "a count exceeds its bound, or a text lacks its terminating zero",
    "the payload is longer than the publisher's buffer",
    "the payload is longer than maxLength",
    "a beat is neither full nor the last one, is empty, or has gaps",
    "the watchdog ended the frame",
    "the sender aborted the frame",
    "a full queue dropped the frame",
    "the checksum of a link is wrong",
};

#endif
