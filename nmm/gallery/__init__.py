"""`nmm gallery`: every bundled scenario with a picture, a page that plays it, its numbers and its file.

card    a scenario run, its files, and what its card says
write   all of it, and index.html, into a folder that appears whole or not at all
"""

from nmm.gallery.card import Card
from nmm.gallery.write import Gallery, write_gallery

__all__ = ["Card", "Gallery", "write_gallery"]
