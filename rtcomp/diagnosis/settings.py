"""All numbers that decide, with what each trades."""

LEVEL = 0.01
"""Level of the one test: share of recordings with nothing missing in which an effect is named."""

LEAST_GAIN = 0.02
"""Least part of the initial rms error by which an effect must lower the rms error. Below it an effect may be
real, but does not matter; much above it what stands beside a strong effect is not looked for."""

NEGLIGIBLE = 3e-3
"""Least force that an effect must explain, over that of the drive, both rms: equations of motion in rows of a
recording are wrong in the third digit, however well a sensor sees it. At 1e-3 creep was named where nothing
was missing."""

REPLICATES = 19
"""Bootstrap replicates behind the null distribution: more make its tail surer and the answer later."""

BEAM = 3
"""Models kept at each step of the search: more find effects that hide each other, and cost time."""

FULL_FITS = 8
"""Candidates refitted in full at each step, best of the screening first."""

MOST_EFFECTS = 4
"""Effects that a model may have beside the belief."""

BLOCK_SECONDS, BLOCK_REVERSALS = 2.0, 3
"""Least length (s) and reversals of a block, where the recording has enough: shorter blocks are not
independent, longer ones are few."""

RESERVED_EVERY = 5
"""Every how manieth block is reserved for the final judgement."""

BELIEF_SD = 0.2
"""Prior standard deviation of a believed number, relative to it."""

ALIAS = 0.03
"""Part of the best candidate's gain that another may lack and still not be told apart from it."""

LEFT = 0.05
"""Part of what there is without an effect (squared, above the noise) that may be left beside it, where that
is more than noise: with more it is the nearest, not the right one; with less true ones of another form than
the catalogue's go unnamed. Settled on the names beside an unexplained rest in seven trials of about 400
cases: of the force, right ones left up to 0.041, two right pairs 0.12 and 0.16, four wrong ones 0.03 to 0.15.
No value parts them, for a name has no rival outside the catalogue."""

TOLERANCE = 0.01
"""Relative force error up to which a model agrees with a recording, whatever the sensor's noise."""

BUDGET = 60.0
"""Time (s) after which the search ends with the best answer so far."""
