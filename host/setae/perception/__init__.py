"""From the points that a bristle touched to shapes.

`cloud` holds points and their files, `maps` height maps and theirs; `paper` is the paper's own way
to compare trials; `features` describes a map by numbers that neither place nor yaw changes, and
`classifier` knows shapes by them; `surface` and `measures` hold a scan against the true surface.
"""
