"""The explorer of a study: one page on which a person filters set-ups and sees what they give.

`content` takes the tables of the study, `charts` draws (Vega-Lite, written with Altair), and `page`
writes all of it into one file, with the tables of DataTables, which `itables` brings.
"""
