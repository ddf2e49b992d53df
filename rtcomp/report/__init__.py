"""What a person looks at: figures, one self-contained HTML page, and what the terminal shows.

Everything here takes arrays and plain values, so that any job, notebook or script can use it. Import what you
need from its module: `quantities`, `decimate`, `figures` (plotly), `page` and `terminal` (rich).
"""
