"""Runs inside QGIS's own Python: draws a layer, with a point of vector data over it if one is given, and prints what it saw as JSON."""

import json
import sys

from qgis.core import (
    QgsApplication,
    QgsCoordinateReferenceSystem,
    QgsFeature,
    QgsGeometry,
    QgsLayerDefinition,
    QgsMapRendererParallelJob,
    QgsMapSettings,
    QgsMarkerSymbol,
    QgsPointXY,
    QgsProject,
    QgsRasterLayer,
    QgsRectangle,
    QgsSingleSymbolRenderer,
    QgsVectorLayer,
)
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor


def open_layer(asked):
    if "definition" in asked:
        root = QgsProject.instance().layerTreeRoot()
        ok, message = QgsLayerDefinition.loadLayerDefinition(asked["definition"], QgsProject.instance(), root)
        assert ok, message
        return next(iter(QgsProject.instance().mapLayers().values()))
    return QgsRasterLayer(asked["source"], "tiles", asked["provider"])


def point_layer(asked):
    layer = QgsVectorLayer(f"Point?crs={asked['crs']}", "points", "memory")
    feature = QgsFeature()
    feature.setGeometry(QgsGeometry.fromPointXY(QgsPointXY(*asked["point"])))
    layer.dataProvider().addFeature(feature)
    layer.updateExtents()
    symbol = QgsMarkerSymbol.createSimple({"name": "square", "color": "0,255,0", "outline_style": "no", "size": "5", "size_unit": "Pixel"})
    layer.setRenderer(QgsSingleSymbolRenderer(symbol))
    return layer


def main(asked):
    layer = open_layer(asked)
    seen = {"valid": layer.isValid(), "crs": layer.crs().description(), "geographic": layer.crs().isGeographic()}
    if not layer.isValid():
        return {**seen, "error": layer.error().summary()}
    extent = layer.extent()
    settings = QgsMapSettings()
    layers = [point_layer(asked), layer] if "point" in asked else [layer]  # the settings do not keep the layers alive
    settings.setLayers(layers)
    settings.setDestinationCrs(layer.crs() if layer.crs().isValid() else QgsCoordinateReferenceSystem())
    settings.setExtent(QgsRectangle(*asked["extent"]) if "extent" in asked else extent)
    settings.setOutputSize(QSize(*asked["size"]))
    settings.setBackgroundColor(QColor(255, 0, 255))
    job = QgsMapRendererParallelJob(settings)
    job.start()
    job.waitForFinished()
    assert job.renderedImage().save(asked["out"])
    return {
        **seen,
        "extent": [extent.xMinimum(), extent.yMinimum(), extent.xMaximum(), extent.yMaximum()],
        "problems": [error.message for error in job.errors()],
    }


QgsApplication.setPrefixPath("/usr", True)
app = QgsApplication([], False)
app.initQgis()
print("RESULT" + json.dumps(main(json.loads(sys.argv[1]))))
sys.stdout.flush()
# The clean-up of QGIS 3.22 may crash at the end of the process.
import os  # noqa: E402

os._exit(0)
