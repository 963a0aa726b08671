/* Frames on a serial line, as frames.py describes them: kind, sequence number, payload, CRC-16, by COBS, then a 0.
 * C99, no memory but the caller's, no library but stdint.h. One receiver for each line. */
#ifndef DETENT_FRAMES_H
#define DETENT_FRAMES_H
#include <stdint.h>

#define FRAME_LONGEST 250 /* bytes of a payload */
#define FRAME_ROOM (FRAME_LONGEST + 5)
#define FRAME_ON_LINE (FRAME_ROOM + 3) /* with the codes of COBS and the 0 */

typedef struct {
    uint32_t good, spoilt, missing, stale;
    uint32_t filled, left; /* bytes of the present frame; bytes until the next code of COBS */
    uint16_t next, number;
    uint8_t kind, begun, bad, block, started; /* block: a code has been read, and a 0 may be due behind its bytes */
    uint8_t data[FRAME_ROOM];
} frame_receiver;

static uint16_t frame_crc(const uint8_t *data, uint32_t count)
{
    uint16_t crc = 0xFFFF;
    for (uint32_t k = 0; k < count; k++) {
        crc ^= (uint16_t)((uint16_t)data[k] << 8);
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)((crc & 0x8000) ? (crc << 1) ^ 0x1021 : crc << 1);
    }
    return crc;
}

/* Write a frame to `line`, which has FRAME_ON_LINE bytes; gives how many it took, 0 where the payload is too long. */
static uint32_t frame_encode(uint8_t kind, uint16_t number, const uint8_t *payload, uint32_t count, uint8_t *line)
{
    uint8_t data[FRAME_ROOM];
    uint32_t filled = 3, code = 0, at = 1;
    if (count > FRAME_LONGEST)
        return 0;
    data[0] = kind;
    data[1] = (uint8_t)(number & 0xFF);
    data[2] = (uint8_t)(number >> 8);
    for (uint32_t k = 0; k < count; k++)
        data[filled++] = payload[k];
    uint16_t crc = frame_crc(data, filled);
    data[filled++] = (uint8_t)(crc & 0xFF);
    data[filled++] = (uint8_t)(crc >> 8);
    for (uint32_t k = 0; k < filled; k++) {
        if (data[k] == 0) {
            line[code] = (uint8_t)(at - code);
            code = at++;
        } else {
            line[at++] = data[k];
        }
    }
    line[code] = (uint8_t)(at - code);
    line[at++] = 0;
    return at;
}

static void frame_put(frame_receiver *r, uint8_t byte)
{
    if (r->filled < FRAME_ROOM)
        r->data[r->filled++] = byte;
    else
        r->bad = 1;
}

/* The 0 has come: 1 where a frame stands in `kind`, `number` and data + 3, filled - 5 bytes. */
static int frame_end(frame_receiver *r)
{
    uint32_t filled = r->filled;
    if (r->bad || r->left || filled < 5 ||
        frame_crc(r->data, filled - 2) != (uint16_t)(r->data[filled - 2] | r->data[filled - 1] << 8)) {
        r->spoilt++;
        return 0;
    }
    r->kind = r->data[0];
    r->number = (uint16_t)(r->data[1] | r->data[2] << 8);
    uint16_t skipped = r->started ? (uint16_t)(r->number - r->next) : 0;
    if (skipped >= 0x8000) {
        r->stale++;
        return 0;
    }
    r->good++;
    r->missing += skipped;
    r->next = (uint16_t)(r->number + 1);
    r->started = 1;
    return 1;
}

/* Take a byte; gives 1 where it completes a frame, which stands there until the next byte. A new receiver is all 0. */
static int frame_feed(frame_receiver *r, uint8_t byte)
{
    if (!r->begun) {
        r->filled = r->left = 0;
        r->bad = r->block = 0;
    }
    if (byte == 0) {
        int whole = r->begun ? frame_end(r) : 0;
        r->begun = 0;
        return whole;
    }
    r->begun = 1;
    if (r->left == 0) {
        if (r->block)
            frame_put(r, 0);
        r->block = 1;
        r->left = (uint32_t)byte - 1;
    } else {
        frame_put(r, byte);
        r->left--;
    }
    return 0;
}
#endif
