/* In the place of what OpenEXR's own build would write: libdeflate is ours. */
#pragma once
