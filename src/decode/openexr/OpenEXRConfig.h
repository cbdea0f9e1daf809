/* In the place of what OpenEXR's own build would write: no shared library, no C++. */
#pragma once

#define OPENEXR_VERSION_MAJOR 3
#define OPENEXR_VERSION_MINOR 5
#define OPENEXR_VERSION_PATCH 3
#define OPENEXR_VERSION_EXTRA ""
#define OPENEXR_EXPORT
#define OPENEXR_HIDDEN
#define OPENEXR_DEPRECATED(message)
