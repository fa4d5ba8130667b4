import json, sys
import numpy as np
T = dict(F64="f8", U64="u8", I64="i8", F32="f4", U32="u4", I32="i4", U16="u2", U8="u1")
raw, row = np.memmap(sys.argv[1], mode="r"), int(sys.argv[2])
n = 8 + int(raw[:8].view("<u8")[0])
A = {k: raw[n:][slice(*h["data_offsets"])].view("<" + T[h["dtype"]]).reshape(h["shape"])
     for k, h in json.loads(raw[8:n].tobytes()).items() if k != "__metadata__"}
for b in range(*map(int, A["row_block"][row:row + 2])):
    word = A["column"][slice(*map(int, A["block_column"][b:b + 2]))]
    value = A["value"][slice(*map(int, A["block_start"][b:b + 2]))].astype("f8")
    if len(word) < len(value):  # spans
        word = np.concatenate([c + 2 * np.arange(k, dtype="u4") for c, k in word.reshape(-1, 2)])
    for c, v in zip(word, value * A["row_scale"][row]):
        print(A["block_chain"][b], c >> 1, "fb"[c & 1], v)
