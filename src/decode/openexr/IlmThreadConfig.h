/* In the place of what OpenEXR's own build would write: there are threads. */
#pragma once

#define ILMTHREAD_THREADING_ENABLED 1
