"""Golden model of the rendering stage, bit for bit.

`fp`      rounding in float32 carriers: the arithmetic of the units
`weight`  the Gaussian weight E in both forms; PRTU and VRU share it
`cat`     contribution test: PRTU, MMU, modes
`vru`     one pixel-Gaussian pair, with every intermediate value
`records` projected splats to hardware records and sub-tile lists
`render`  whole frames
"""
