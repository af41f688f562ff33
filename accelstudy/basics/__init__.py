"""The ground floor: units, errors, words, names and numbers, which every room stands on."""
