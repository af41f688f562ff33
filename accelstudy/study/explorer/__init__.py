"""The explorer of a study: one page on which a person chooses set-ups and sees what they give.

`content` takes the tables of the study, `links` says which figures show a set-up, `charts` draws
(Vega-Lite, written with Altair), `library` is what draws them in the browser, and `page` writes all
of it into one file.
"""
