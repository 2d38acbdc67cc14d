"""The folders of a run, a comparison, laps and a map: written whole or not at all (`whole`), and validated
when read back (`schema`); and which kind a folder is (`kinds`)."""
