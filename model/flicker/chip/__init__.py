"""Model of the rest of the chip: a proposal with stated assumptions, to which the RTL of these units will be held.

`constants` every number with its source; `clusters` culling; `memory` parameter formats; `lists` sub-tile lists and
their sorting; `dram` LPDDR4 timing; `frame` the estimate of a whole frame; `command` the `flicker chip` command.
"""
