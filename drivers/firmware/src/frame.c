#include "frame.h"

#include <string.h>

uint32_t rt_crc32(const uint8_t *data, size_t size)
{
    /* Two table look-ups a byte: 64 bytes of table instead of 1024, for boards that have little. */
    static const uint32_t table[16] = {
        0x00000000u, 0x1db71064u, 0x3b6e20c8u, 0x26d930acu, 0x76dc4190u, 0x6b6b51f4u, 0x4db26158u, 0x5005713cu,
        0xedb88320u, 0xf00f9344u, 0xd6d6a3e8u, 0xcb61b38cu, 0x9b64c2b0u, 0x86d3d2d4u, 0xa00ae278u, 0xbdbdf21cu,
    };
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < size; i++) {
        crc = table[(crc ^ data[i]) & 15u] ^ (crc >> 4);
        crc = table[(crc ^ (uint32_t)(data[i] >> 4)) & 15u] ^ (crc >> 4);
    }
    return ~crc;
}

/* Undo COBS in place; returns the length, RT_BAD where it is none. */
static int unstuff(uint8_t *bytes, int size)
{
    int in = 0, out = 0;
    while (in < size) {
        const int code = bytes[in];
        if (code == 0 || code == 0xff || in + code > size) {
            return RT_BAD;
        }
        memmove(bytes + out, bytes + in + 1, (size_t)(code - 1));
        out += code - 1;
        in += code;
        if (in < size) {
            bytes[out++] = 0;
        }
    }
    return out;
}

static int payload_of(uint8_t *bytes, int size)
{
    const int length = unstuff(bytes, size);
    if (length <= RT_CRC_SIZE) {
        return RT_BAD;
    }
    const int payload = length - RT_CRC_SIZE;
    const uint8_t *end = bytes + payload;
    const uint32_t sent = (uint32_t)end[0] | (uint32_t)end[1] << 8 | (uint32_t)end[2] << 16 | (uint32_t)end[3] << 24;
    return rt_crc32(bytes, (size_t)payload) == sent ? payload : RT_BAD;
}

int rt_receive(rt_receiver *receiver, uint8_t byte)
{
    if (byte != 0) {
        if (receiver->skipping) {
            return RT_NOTHING;
        }
        if (receiver->count == RT_MAX_FRAME) {
            receiver->skipping = 1;
            receiver->count = 0;
            return RT_BAD;
        }
        receiver->bytes[receiver->count++] = byte;
        return RT_NOTHING;
    }
    const int count = receiver->count;
    const int skipped = receiver->skipping;
    receiver->count = 0;
    receiver->skipping = 0;
    if (skipped || count == 0) { /* counted already; a lone zero flushes the line */
        return RT_NOTHING;
    }
    return payload_of(receiver->bytes, count);
}

size_t rt_frame(const uint8_t *payload, size_t size, uint8_t *frame)
{
    if (size == 0 || size > RT_MAX_PAYLOAD) {
        return 0;
    }
    const uint32_t crc = rt_crc32(payload, size);
    size_t run = 0, out = 1; /* where the length of the present run goes, and what follows */
    for (size_t i = 0; i < size + RT_CRC_SIZE; i++) {
        uint8_t byte;
        if (i < size) {
            byte = payload[i];
        } else {
            byte = (uint8_t)(crc >> (8 * (i - size)));
        }
        if (byte == 0) {
            frame[run] = (uint8_t)(out - run);
            run = out++;
        } else {
            frame[out++] = byte;
        }
    }
    frame[run] = (uint8_t)(out - run);
    frame[out++] = 0;
    return out;
}
