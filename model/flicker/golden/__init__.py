"""Golden model of the hardware, bit for bit (docs/reference/golden_model.md).

`weight`  the Gaussian weight E in both forms; PRTU and VRU share it (rounding: `flicker.arithmetic.fp`)
`cat`     contribution test: PRTU, MMU, modes
`vru`     one pixel-Gaussian pair, with every intermediate value
`render`  whole frames of the stage of channels (records and lists: `flicker.front.records`)
`lanes`   the stage of lanes
`front`   front end
`chip`    the chip's picture
"""
