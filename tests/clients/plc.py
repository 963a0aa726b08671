"""What a PLC does, in twenty lines: heartbeat, target, command, sequence number, acknowledgement."""

import sys

from pymodbus.client import ModbusTcpClient

plc = ModbusTcpClient("127.0.0.1", port=int(sys.argv[1]))
plc.connect()
beat, sequence = plc.read_holding_registers(40).registers[0], plc.read_holding_registers(23).registers[0]


def command(number, target=0):
    """Let the axis do something, and wait for its end: 2 done, 3 aborted, 4 refused, 5 failed; and the reason."""
    global beat, sequence
    sequence, ended = (sequence + 1) % 65536, False
    plc.write_registers(41, [number, target >> 16 & 0xFFFF, target & 0xFFFF, 0, 0])
    while not ended:
        beat = (beat + 1) % 65536
        plc.write_register(40, beat)
        plc.write_register(46, sequence)
        acknowledged, result, reason = plc.read_holding_registers(23, count=3).registers
        ended = acknowledged == sequence and result != 1
    return result, reason


print("enable:", *command(1))
print("move:", *command(7, 45_000))
high, low = plc.read_holding_registers(16, count=2).registers
print("at", round(high << 16 | low, -2), "counts")
