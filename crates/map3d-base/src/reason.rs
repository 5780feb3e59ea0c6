//! The reasons for which readers skip parts of a document or warn of them. spec/messages.json has their texts, and a test compares the two.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use serde_json::Value;

/// What a reason means for the part that has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// A fault that was repaired or worked around.
    Warning,
    /// Worth knowing, but not a fault.
    Note,
    /// Broken and left out.
    Skipped,
    /// Valid and left out by design.
    Omitted,
}

macro_rules! reasons {
    ($($name:ident = $code:literal: $severity:ident,)*) => {
        /// Why a part of a document is skipped or reported. Serialized as its code.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
        pub enum Reason {
            $(#[serde(rename = $code)] $name,)*
        }

        impl Reason {
            pub const ALL: &[Self] = &[$(Self::$name,)*];

            pub fn code(self) -> &'static str {
                match self {
                    $(Self::$name => $code,)*
                }
            }

            pub fn severity(self) -> Severity {
                match self {
                    $(Self::$name => Severity::$severity,)*
                }
            }
        }
    };
}

reasons! {
    ImageFileNotFound = "image-file-not-found": Warning,
    ImageFileOutsideFolder = "image-file-outside-folder": Warning,
    ImageUrlNotFetched = "image-url-not-fetched": Warning,
    ImageNotARegularFile = "image-not-a-regular-file": Warning,
    ImageFileNameInvalid = "image-file-name-invalid": Warning,
    ImageFormatUnknown = "image-format-unknown": Warning,
    ImageFormatNotRead = "image-format-not-read": Warning,
    ImageHeaderInvalid = "image-header-invalid": Warning,
    ImageWithoutPixels = "image-without-pixels": Warning,
    ImageSideOverLimit = "image-side-over-limit": Warning,
    ImagePixelsOverLimit = "image-pixels-over-limit": Warning,
    ImageUnreadable = "image-unreadable": Warning,
    ImageDamaged = "image-damaged": Warning,
    ImageKindNotRead = "image-kind-not-read": Warning,
    ImageUnusable = "image-unusable": Warning,
    GeoreferencedTextureWithoutPlace = "georeferenced-texture-without-place": Warning,
    GeoreferencedTextureInOtherCrs = "georeferenced-texture-in-other-crs": Warning,
    GeoreferencedTextureInexact = "georeferenced-texture-inexact": Warning,
    RingsCross = "rings-cross": Warning,
    RingNotClosed = "ring-not-closed": Warning,
    ReferenceUnresolved = "reference-unresolved": Warning,
    PartInOtherFile = "part-in-other-file": Warning,
    OtherFileNotFound = "other-file-not-found": Warning,
    OtherFileOutsideFolder = "other-file-outside-folder": Warning,
    OtherFileUrlNotFetched = "other-file-url-not-fetched": Warning,
    OtherFileNotARegularFile = "other-file-not-a-regular-file": Warning,
    OtherFileNameInvalid = "other-file-name-invalid": Warning,
    OtherFileWithoutGeometry = "other-file-without-geometry": Warning,
    OtherFileChainTooLong = "other-file-chain-too-long": Warning,
    OtherFilesTooLarge = "other-files-too-large": Warning,
    OtherFileReferencesTooMany = "other-file-references-too-many": Warning,
    OtherFileBroken = "other-file-broken": Note,
    AppearanceTargetNotFound = "appearance-target-not-found": Warning,
    AppearanceTargetMissing = "appearance-target-missing": Warning,
    AppearanceTargetIsRing = "appearance-target-is-ring": Note,
    AppearanceForOtherFile = "appearance-for-other-file": Note,
    MaterialNotDefined = "material-not-defined": Warning,
    TinMaxLengthInvalid = "tin-max-length-invalid": Warning,
    TinHeightsDiffer = "tin-heights-differ": Warning,
    WrapModeUnknown = "wrap-mode-unknown": Warning,
    LibraryObjectNotFound = "library-object-not-found": Warning,
    LibraryObjectOutsideFolder = "library-object-outside-folder": Warning,
    LibraryObjectUrlNotFetched = "library-object-url-not-fetched": Warning,
    LibraryObjectNotARegularFile = "library-object-not-a-regular-file": Warning,
    LibraryObjectFileNameInvalid = "library-object-file-name-invalid": Warning,
    LibraryObjectFormatNotRead = "library-object-format-not-read": Warning,
    MaterialLibraryNotFound = "material-library-not-found": Warning,
    MaterialLibraryOutsideFolder = "material-library-outside-folder": Warning,
    MaterialLibraryUrlNotFetched = "material-library-url-not-fetched": Warning,
    MaterialLibraryNotARegularFile = "material-library-not-a-regular-file": Warning,
    MaterialLibraryFileNameInvalid = "material-library-file-name-invalid": Warning,
    MaterialLibraryUnnamed = "material-library-unnamed": Warning,
    MaterialDefinedTwice = "material-defined-twice": Note,
    AlphaMapIgnored = "alpha-map-ignored": Note,
    BlackMaterialWithTexture = "black-material-with-texture": Note,
    TextureIndexOutOfRange = "texture-index-out-of-range": Warning,
    NormalIndexOutOfRange = "normal-index-out-of-range": Warning,
    FaceEdgesCross = "face-edges-cross": Warning,
    FileNameBackslashes = "file-name-backslashes": Note,
    FileNamePercentEncoded = "file-name-percent-encoded": Note,
    FileNameCaseDiffers = "file-name-case-differs": Note,
    FileNameAbsolute = "file-name-absolute": Note,
    TransparencyReadAsOpacity = "transparency-read-as-opacity": Note,
    TransparentSurfacesNotDrawn = "transparent-surfaces-not-drawn": Note,
    InteriorsNotDrawn = "interiors-not-drawn": Note,
    DocumentBroken = "document-broken": Note,
    EncodingUnknown = "encoding-unknown": Warning,
    NotUtf8AsDeclared = "not-utf-8-as-declared": Warning,
    ZeroBytesLeftOut = "zero-bytes-left-out": Warning,
    GzipDamaged = "gzip-damaged": Warning,
    NothingAtLod = "nothing-at-lod": Note,
    ThemeUsed = "theme-used": Note,
    ThemeWithoutImages = "theme-without-images": Note,
    ThemeNotInFile = "theme-not-in-file": Note,
    AppearanceOfOtherTheme = "appearance-of-other-theme": Note,
    AppearanceOfBackSide = "appearance-of-back-side": Note,
    SurfaceDataNotRead = "surface-data-not-read": Warning,
    TextureWithoutParameterization = "texture-without-parameterization": Warning,
    TextureCoordinatesMissingForHole = "texture-coordinates-missing-for-hole": Warning,
    TextureCoordinatesTooFew = "texture-coordinates-too-few": Warning,
    TextureParameterizationUnknown = "texture-parameterization-unknown": Warning,
    TextureCoordinatesUnreadable = "texture-coordinates-unreadable": Warning,
    TextureMatrixUnreadable = "texture-matrix-unreadable": Warning,
    ElementUnknown = "element-unknown": Note,
    GeometryWithoutLod = "geometry-without-lod": Note,
    CodeListNotRead = "code-list-not-read": Note,
    ReliefGridElsewhere = "relief-grid-elsewhere": Warning,
    ReliefExtentNotApplied = "relief-extent-not-applied": Note,
    CoordinateNotFinite = "coordinate-not-finite": Skipped,
    CoordinateTooFar = "coordinate-too-far": Skipped,
    FaceWithTooFewVertices = "face-with-too-few-vertices": Skipped,
    FaceOverLimit = "face-over-limit": Skipped,
    FreeFormGeometry = "free-form-geometry": Skipped,
    FaceTransparent = "face-transparent": Omitted,
    PolygonTransparent = "polygon-transparent": Omitted,
    GeometryRefersToItself = "geometry-refers-to-itself": Skipped,
    GridPointsWithoutHeight = "grid-points-without-height": Omitted,
    ImplicitGeometryCrsTooMany = "implicit-geometry-crs-too-many": Skipped,
    ImplicitGeometryMatrixInvalid = "implicit-geometry-matrix-invalid": Skipped,
    ImplicitGeometryWithoutPrototype = "implicit-geometry-without-prototype": Skipped,
    ImplicitGeometryWithoutReferencePoint = "implicit-geometry-without-reference-point": Skipped,
    IndexOutOfRange = "index-out-of-range": Skipped,
    PointsAndLines = "points-and-lines": Omitted,
    PolygonInSeveralCrs = "polygon-in-several-crs": Skipped,
    PolygonCrsTooMany = "polygon-crs-too-many": Skipped,
    VersionEnded = "version-ended": Omitted,
    VersionOfOtherDate = "version-of-other-date": Omitted,
    PolygonOfInterior = "polygon-of-interior": Omitted,
    PolygonNotTriangulated = "polygon-not-triangulated": Skipped,
    PolygonWithTooManyVertices = "polygon-with-too-many-vertices": Skipped,
    PolygonCoordinatesUnreadable = "polygon-coordinates-unreadable": Skipped,
    PolygonWithoutHeight = "polygon-without-height": Warning,
    PolygonWithoutArea = "polygon-without-area": Skipped,
    PolygonWithoutRings = "polygon-without-rings": Skipped,
    RingWithTooFewPoints = "ring-with-too-few-points": Skipped,
    RingOverLimit = "ring-over-limit": Skipped,
    SolidOfOpenSpace = "solid-of-open-space": Omitted,
    StrayVertex = "stray-vertex": Skipped,
    TextureCoordinateNotFinite = "texture-coordinate-not-finite": Skipped,
    TinBreakLinesCross = "tin-break-lines-cross": Skipped,
    TinPointsOnALine = "tin-points-on-a-line": Skipped,
    TinNotTriangulated = "tin-not-triangulated": Skipped,
    TinWithTooFewPoints = "tin-with-too-few-points": Skipped,
    TinPointNotFinite = "tin-point-not-finite": Skipped,
    TinInSeveralCrs = "tin-in-several-crs": Skipped,
    TinCrsTooMany = "tin-crs-too-many": Skipped,
    TinWithTooManyPoints = "tin-with-too-many-points": Skipped,
    TinTriangleAtStopLine = "tin-triangle-at-stop-line": Omitted,
    TinTriangleTooLong = "tin-triangle-too-long": Omitted,
    TinCoordinatesUnreadable = "tin-coordinates-unreadable": Skipped,
    FaceUnreadable = "face-unreadable": Skipped,
    VertexUnreadable = "vertex-unreadable": Skipped,
    GeometryTypeNotRead = "geometry-type-not-read": Omitted,
    ZeroArea = "zero-area": Skipped,
    ReliefGridWithoutHeights = "relief-grid-without-heights": Skipped,
    ReliefGridWithoutPlace = "relief-grid-without-place": Skipped,
    ReliefGridIncomplete = "relief-grid-incomplete": Skipped,
    ReliefGridTooSmall = "relief-grid-too-small": Skipped,
    ReliefGridOrderNotRead = "relief-grid-order-not-read": Skipped,
    ReliefGridWithoutArea = "relief-grid-without-area": Skipped,
    ReliefGridCrsTooMany = "relief-grid-crs-too-many": Skipped,
    ReliefGridHeightsDoNotFit = "relief-grid-heights-do-not-fit": Skipped,
    ReliefGridWithTooManyHeights = "relief-grid-with-too-many-heights": Skipped,
    ReliefTriangleOutsideExtent = "relief-triangle-outside-extent": Omitted,
    ReliefFileNotFound = "relief-file-not-found": Skipped,
    ReliefFileOutsideFolder = "relief-file-outside-folder": Skipped,
    ReliefUrlNotFetched = "relief-url-not-fetched": Skipped,
    ReliefFileNotARegularFile = "relief-file-not-a-regular-file": Skipped,
    ReliefFileNameInvalid = "relief-file-name-invalid": Skipped,
}

impl Reason {
    /// Returns true if the examples are files that people have to repair: a report names the first of them.
    pub fn names_files(self) -> bool {
        matches!(
            self,
            Self::ImageFormatUnknown
                | Self::ImageFormatNotRead
                | Self::ImageHeaderInvalid
                | Self::ImageWithoutPixels
                | Self::ImageUnreadable
                | Self::ImageDamaged
                | Self::ImageKindNotRead
        )
    }

    /// Returns the reason with a value that its text names.
    pub fn with(self, name: &'static str, value: impl Into<Value>) -> Message {
        Message { reason: self, values: BTreeMap::from([(name, value.into())]) }
    }
}

/// A reason and the values that its text names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Message {
    #[serde(rename = "code")]
    pub reason: Reason,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<&'static str, Value>,
}

impl From<Reason> for Message {
    fn from(reason: Reason) -> Self {
        Self { reason, values: BTreeMap::new() }
    }
}

/// The reason of one fault in words, for an error: `ring over limit (limit 200000)`.
impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason.code().replace('-', " "))?;
        self.values.iter().try_for_each(|(name, value)| write!(f, " ({name} {value})"))
    }
}
