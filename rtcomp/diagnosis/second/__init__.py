"""The second design of the diagnosis: one objective, one test, one search, one final judgement.

It stands beside the first until it is not worse on any score (`tools/compare_diagnosis.py`). Read
`pipeline.py` from top to bottom.
"""
