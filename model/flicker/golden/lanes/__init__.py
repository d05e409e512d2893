"""Rendering stage whose lanes work in the log domain, bit for bit: raw records of 16 bytes and sub-tile lists to finished pixels (docs/reference/lanes.md).

`formats` number formats, constants and tables
`setup`   per splat and sub-tile: record to u, v at the middle and their slopes
`mask`    row intervals: the pixels that can contribute
`lane`    one pixel-Gaussian pair, and the result of a pixel
`lists`   records and sub-tile lists
`streams` lists of the cores, each of one or several sub-tiles
`render`  whole frames
"""
