import json, sys
import numpy as np
T = dict(F64="f8", U64="u8", I64="i8", F32="f4", U32="u4", I32="i4", U16="u2", U8="u1")
raw = np.memmap(sys.argv[1], mode="r")
n = 8 + int(raw[:8].view("<u8")[0])
head = json.loads(raw[8:n].tobytes())
meta = head.pop("__metadata__")
for name, h in head.items():
    a = raw[n:][slice(*h["data_offsets"])].view("<" + T[h["dtype"]]).reshape(h["shape"])
    print(name, h["dtype"], h["shape"], a.mean() if a.size else "-")
