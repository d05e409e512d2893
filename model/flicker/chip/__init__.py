"""Model of the rest of the chip: a proposal with stated assumptions, to which the RTL of these units will be held.

`constants` every number with its source; `clusters` culling; `memory` parameter formats; `schemes` ways to make
the sub-tile lists, `lists` building them, `sorting` the sorting unit, `delivery` what the cores take of them, `execute` a scheme
as a whole; `dram` LPDDR4 timing; `frame` the estimate of a whole frame, `compare` that of
configurations.
"""
