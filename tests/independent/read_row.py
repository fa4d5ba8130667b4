import json, sys
import numpy as np
T = dict(F64="f8", U64="u8", I64="i8", F32="f4", U32="u4", I32="i4", U16="u2", U8="u1")
raw, row = np.memmap(sys.argv[1], mode="r"), int(sys.argv[2])
n = 8 + int(raw[:8].view("<u8")[0])
A = {k: raw[n:][slice(*h["data_offsets"])].view("<" + T[h["dtype"]]).reshape(h["shape"])
     for k, h in json.loads(raw[8:n].tobytes()).items() if k != "__metadata__"}
blocks = A["row_block"][row:row + 2] if "row_block" in A else (row, row + 1)
for b in range(*map(int, blocks)):
    value = A["value"][slice(*map(int, A["block_start"][b:b + 2]))].astype("f8")
    word, spans = divmod(int(A["block_column"][b]), 2)
    column = A["column"][word:word + len(value)].astype("u4")
    if spans:  # of fewer words than values: what is behind them is cut off
        column = np.concatenate([c + 2 * np.arange(k, dtype="u4") for c, k in
                                 zip(column[::2], column[1::2])])[:len(value)]
    chain = A["block_chain"][b] if "block_chain" in A else 0
    for c, v in zip(column, value * A["row_scale"][row]):
        print(chain, c >> 1, "fb"[c & 1], v)
