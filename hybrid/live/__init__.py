"""The live view of a scene while it is written, and of a result, a running one too: a page on this machine alone.

server    the page and its websocket, for this machine alone     session   one scene, its text, its browsers
worker    a process that computes pictures of texts              pictures  from a scene, or a result, to numbers
runs      the motion in a process of its own                     playback  outputs of a result file, as they come
"""
