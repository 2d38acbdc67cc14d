from .video import render as render
