"""Latches and the status queue: nothing overwritten, nothing out of order, loss counted."""

from detent.control.latch import QUEUE_LENGTH, Latch, StatusPort, pass_on, read_latch, send, write_latch


def test_writing_raises_the_flag_and_reading_clears_it():
    r = Latch()
    write_latch(r, 0x1A5)
    assert (r.byte, r.flag) == (0xA5, 1)
    assert read_latch(r) == 0xA5
    assert (r.byte, r.flag) == (0xA5, 0)


def test_an_unread_status_is_never_overwritten():
    r = StatusPort()
    for byte in (1, 2, 3):
        send(r, byte)
    assert (r.latch.byte, r.latch.flag, r.waiting) == (1, 1, 2)
    pass_on(r)
    assert (r.latch.byte, r.waiting) == (1, 2)
    found = [read_latch(r.latch)]
    while r.waiting:
        pass_on(r)
        found.append(read_latch(r.latch))
    pass_on(r)
    assert found == [1, 2, 3]
    assert r.latch.flag == 0


def test_order_is_kept_round_the_end_of_the_queue():
    r = StatusPort()
    found = []
    for n in range(5 * QUEUE_LENGTH):
        send(r, n % 251)
        if n % 3:
            found.append(read_latch(r.latch))
            pass_on(r)
        if r.waiting > QUEUE_LENGTH - 2:
            while r.latch.flag:
                found.append(read_latch(r.latch))
                pass_on(r)
    while r.latch.flag:
        found.append(read_latch(r.latch))
        pass_on(r)
    assert found == [n % 251 for n in range(5 * QUEUE_LENGTH)]
    assert r.lost == 0


def test_what_does_not_fit_is_counted_and_leaves_the_rest_alone():
    r = StatusPort()
    for n in range(QUEUE_LENGTH + 1):  # one in the latch, the rest in the queue
        send(r, n)
    assert (r.waiting, r.lost) == (QUEUE_LENGTH, 0)
    send(r, 99)
    send(r, 99)
    assert (r.waiting, r.lost) == (QUEUE_LENGTH, 2)
    found = []
    while r.latch.flag:
        found.append(read_latch(r.latch))
        pass_on(r)
    assert found == list(range(QUEUE_LENGTH + 1))
