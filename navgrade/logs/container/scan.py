"""The loop over records, in a module of its own: many a file is read without a compiler."""

import numpy as np

from earth._jit import kernel


@kernel
def scan(records, at, starts):
    """Place of each record's content, until the first that cannot be one; where it stopped."""
    count = 0
    size = len(records)
    while at + 9 <= size and count < len(starts):
        opcode = records[at]
        if opcode == 0 or opcode == 1 or opcode == 2 or (opcode > 5 and opcode < 16):
            break
        length = np.uint64(0)
        for k in range(8):
            length |= np.uint64(records[at + 1 + k]) << np.uint64(8 * k)
        if length > np.uint64(size - at - 9) or (opcode == 5 and length < 22):
            break
        starts[count] = at + 9
        count += 1
        at += 9 + int(length)
    return count, at
