"""What goes into the bundle that nothing imports by its name, and what stays out of it."""

PACKAGES = ("kappaskin", "kappaskin_app")
"""Those of which every module goes in: rooms, transports and pages are imported by name."""

VTK = (
    "ChartsCore",
    "CommonColor",
    "CommonComputationalGeometry",
    "CommonCore",
    "CommonDataModel",
    "CommonExecutionModel",
    "CommonMath",
    "CommonMisc",
    "CommonSystem",
    "CommonTransforms",
    "FiltersCore",
    "FiltersExtraction",
    "FiltersGeneral",
    "FiltersGeometry",
    "FiltersModeling",
    "FiltersPython",
    "FiltersSources",
    "IOCore",
    "IOImage",
    "ImagingCore",
    "ImagingMath",
    "ImagingSources",
    "InteractionStyle",
    "InteractionWidgets",
    "ParallelCore",
    "PythonContext2D",
    "RenderingAnnotation",
    "RenderingContext2D",
    "RenderingContextOpenGL2",
    "RenderingCore",
    "RenderingFreeType",
    "RenderingHyperTreeGrid",
    "RenderingLabel",
    "RenderingMatplotlib",
    "RenderingOpenGL2",
    "RenderingUI",
    "RenderingVolume",
    "RenderingVolumeOpenGL2",
    "ViewsContext2D",
    "ViewsCore",
)
"""The parts of VTK that PyVista asks for, by name, while the app runs; all would be 500 MB."""

HIDDEN = (
    "kappaskin_resources",
    "h5py",
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
    "vtkmodules.numpy_interface.dataset_adapter",
    "vtkmodules.util.numpy_support",
    "vtkmodules.util.pickle_support",
    "vtkmodules.util.vtkAlgorithm",
    *(f"vtkmodules.vtk{part}" for part in VTK),
)
"""Modules that are imported by a name in a string."""

EXCLUDED = (
    # Of extras: a cluster has its own, ffmpeg is large, and comparing is for who works on this.
    *("dask", "distributed", "imageio_ffmpeg", "skfem"),
    *("hypothesis", "psutil", "pytest", "pydoc_data", "tkinter", "IPython"),
    *("PySide6.QtDBus", "PySide6.QtNetwork", "PySide6.QtTest", "pyqtgraph.opengl"),
    "PIL.AvifImagePlugin",
    *("vtk", "vtkmodules.all"),  # PyVista names it for type checkers, and it is all of VTK
    *("cffi", "zstandard._cffi", "zstandard.backend_cffi"),  # a second way beside the compiled one
)
"""Modules that something names and the app never imports."""

QT_PLUGINS = (
    "iconengines/libqsvgicon",
    "imageformats/libqjpeg",
    "imageformats/libqsvg",
    "platforminputcontexts/",
    "platforms/libqoffscreen",
    "platforms/libqwayland",
    "platforms/libqxcb",
    "platformthemes/libqxdgdesktopportal",
    "wayland-",
    "xcbglintegrations/",
)
"""Beginnings of the Qt plugins that go in on Linux; elsewhere all do."""
