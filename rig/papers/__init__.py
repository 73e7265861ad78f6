"""The source papers, reproduced: one item for each numbered equation, figure and table that can be computed.

An item computes what the paper prints and sets both side by side; `rig papers` runs them. Adding one: write a function
that takes a Workbench and gives an Outcome, and name it in an `Item` of its paper's `ITEMS`.
"""
