/* SPDX-License-Identifier: Apache-2.0 */
/* The sizes of a node. Its memory is static, so they must be known when it is compiled. A node defines its own sizes
 * with
 * -D, or in a header whose name is in FIRM_CONFIG_HEADER. */
#ifndef FIRM_CONFIG_H
#define FIRM_CONFIG_H

#ifdef FIRM_CONFIG_HEADER
#include FIRM_CONFIG_HEADER
#endif

#ifndef FIRM_WIDTH
#define FIRM_WIDTH 8 /* bits of the system's streams */
#endif
#ifndef FIRM_SUBSCRIBERS
#define FIRM_SUBSCRIBERS 1
#endif
#ifndef FIRM_PUBLISHERS
#define FIRM_PUBLISHERS 1
#endif
#ifndef FIRM_LONGEST_PAYLOAD
#define FIRM_LONGEST_PAYLOAD 1024 /* bytes, in either direction */
#endif
#ifndef FIRM_QUEUE_DEPTH
#define FIRM_QUEUE_DEPTH 4 /* frames, for each subscriber */
#endif
#ifndef FIRM_WRITERS
#define FIRM_WRITERS 1 /* tasks that may put payloads at the same time */
#endif
#ifndef FIRM_UART_STORE_BYTES
#define FIRM_UART_STORE_BYTES (2 * FIRM_LONGEST_PAYLOAD + 128) /* received bytes that wait while a frame is sent */
#endif
#ifndef FIRM_UART_PATIENCE_MS
#define FIRM_UART_PATIENCE_MS 1000 /* until a frame is lost because the line takes no byte */
#endif
#ifndef FIRM_DMA_BUFFERS
#define FIRM_DMA_BUFFERS 4 /* in each direction */
#endif
#ifndef FIRM_DMA_BUFFER_BYTES
#define FIRM_DMA_BUFFER_BYTES 2048 /* a multiple of 64, less than 64 MiB; a longer frame takes several */
#endif
#ifndef FIRM_DMA_ADDRESS_BITS
#define FIRM_DMA_ADDRESS_BITS 32 /* of the engine, 32 to 64; generated block designs have 32 */
#endif

/* For an illegal size, the compiler stops at a line that names the rule. */
typedef char firm_width_is_8_to_512[(FIRM_WIDTH >= 8 && FIRM_WIDTH <= 512 && (FIRM_WIDTH & (FIRM_WIDTH - 1)) == 0) ? 1 : -1];
typedef char firm_ids_are_one_byte[(FIRM_SUBSCRIBERS >= 1 && FIRM_SUBSCRIBERS <= 256 && FIRM_PUBLISHERS >= 1 &&
                                    FIRM_PUBLISHERS <= 256)
                                       ? 1
                                       : -1];
typedef char firm_dma_buffers_are_aligned[(FIRM_DMA_BUFFER_BYTES > 0 && FIRM_DMA_BUFFER_BYTES % 64 == 0 &&
                                           FIRM_DMA_BUFFERS >= 2)
                                              ? 1
                                              : -1];
/* A descriptor has 26 bits for a length. */
typedef char firm_dma_buffers_fit_a_length[FIRM_DMA_BUFFER_BYTES < (1L << 26) ? 1 : -1];
typedef char firm_dma_addresses_are_32_to_64_bits[(FIRM_DMA_ADDRESS_BITS >= 32 && FIRM_DMA_ADDRESS_BITS <= 64) ? 1 : -1];

#endif
