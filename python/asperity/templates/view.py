"""contact.vtkhdf in ParaView: the deformed solid coloured by stress, under the flat.

paraview --script=view.py     in this folder: opens a window
pvpython view.py FILE.png     writes a picture of the last state
"""

import os
import sys

from paraview import simple

folder = os.path.dirname(os.path.abspath(globals().get("__file__", "view.py")))  # a window knows no file
solid = simple.OpenDataFile(os.path.join(folder, "contact.vtkhdf"))
deformed = simple.WarpByVector(registrationName="deformed solid", Input=solid)
deformed.Vectors = ["POINTS", "displacement"]
deformed.ScaleFactor = 1.0
flat = simple.Plane(registrationName="flat", Origin=[0, 0, 1], Point1=[1, 0, 1], Point2=[0, 1, 1])

view = simple.GetActiveViewOrCreate("RenderView")
shown = simple.Show(deformed, view)
simple.ColorBy(shown, ("CELLS", "von Mises stress"))
simple.Show(flat, view).Opacity = 0.2

scene = simple.GetAnimationScene()
scene.UpdateAnimationUsingDataTimeSteps()
times, frames = list(solid.TimestepValues), []
for time in times:
    deformed.UpdatePipeline(time)
    height = deformed.GetDataInformation().GetBounds()[5]  # the touched nodes are the highest
    share = (time - times[0]) / (times[-1] - times[0] or 1.0)
    frames.append(simple.CompositeKeyFrame(KeyTime=share, KeyValues=[height]))
for corner in ("Origin", "Point1", "Point2"):
    simple.GetAnimationTrack(corner, 2, flat).KeyFrames = frames
scene.GoToLast()

shown.RescaleTransferFunctionToDataRange(False, True)
shown.SetScalarBarVisibility(view, True)
view.CameraFocalPoint, view.CameraPosition, view.CameraViewUp = (0.5, 0.5, 0.5), (1.5, -1.5, 1.8), (0.0, 0.0, 1.0)
simple.ResetCamera(view)
simple.Render(view)
if sys.argv[-1].endswith(".png"):
    simple.SaveScreenshot(sys.argv[-1], view, ImageResolution=[1200, 900])
