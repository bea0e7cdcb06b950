"""Where the gap of sim and real lies, which effect causes it, and how far it shrinks with that effect.

log         trajectories cut into windows, their noise floor, and residuals in units of it
simulate    what a simulator with other effects and another calibration answers to the log's commands
hypothesis  effects with their parameters and the calibration, fitted on one part of the log and scored on the other
search      which set of effects explains the log: screening, stepwise selection, plausibility
verdict     what the evidence allows to say, and the report
design      what to play next
"""
