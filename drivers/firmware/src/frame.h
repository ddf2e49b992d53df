/* Frames on the line: COBS(payload ++ CRC-32) 0x00. See drivers/README.md, which specifies every byte. */
#ifndef RTCOMP_FRAME_H
#define RTCOMP_FRAME_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    RT_MAX_PAYLOAD = 246, /* most bytes of payload; with the CRC no run between zeros reaches 254 */
    RT_CRC_SIZE = 4,
    RT_MAX_FRAME = RT_MAX_PAYLOAD + RT_CRC_SIZE + 1, /* most bytes before a frame's closing zero */
    RT_NOTHING = 0,
    RT_BAD = -1
};

/* Collects a frame from bytes as they come. */
typedef struct {
    uint8_t bytes[RT_MAX_FRAME];
    uint16_t count;
    uint8_t skipping; /* the rest of a piece that is longer than any frame */
} rt_receiver;

/* CRC-32 as Ethernet and zlib have it. */
uint32_t rt_crc32(const uint8_t *data, size_t size);

/* Take one byte. Returns the payload's length where it completes a good frame, whose payload then begins at
 * receiver->bytes; RT_BAD where it ends a piece that is none; else RT_NOTHING. */
int rt_receive(rt_receiver *receiver, uint8_t byte);

/* Write the frame of `payload`, 1 to RT_MAX_PAYLOAD bytes, with its closing zero; `frame` has room for
 * RT_MAX_FRAME + 1 bytes. Returns the frame's length, 0 where the payload's is not allowed. */
size_t rt_frame(const uint8_t *payload, size_t size, uint8_t *frame);

#ifdef __cplusplus
}
#endif
#endif
