"""shows_something PNG: fails unless the picture has an object with some texture before a plain ground."""
import sys

from PIL import Image

picture = Image.open(sys.argv[1]).convert("RGB")
colours = picture.getcolors(picture.width * picture.height)
ground = max(colours)[0]
covered = 1 - ground / (picture.width * picture.height)
if not (0.05 < covered < 0.95 and len(colours) > 200):
    sys.exit(f"{sys.argv[1]}: expected an object with a texture, found {covered:.2f} of the picture in {len(colours)} colours")
