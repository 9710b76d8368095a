// The data of the page: the views, their pictures and the rig. report/views.py packs them.

export const DATA = JSON.parse(document.getElementById("data").textContent);
// The depth code of a miss: infinitely far.
export const MISS = DATA.depth ? DATA.depth.steps - 1 : 0;
// The numbers of the views in the epipolar row, and of those whose pictures the page holds.
export const row = new Set(DATA.row ? DATA.row.views : []);
export const shown = new Set(DATA.embedded.map((entry) => entry.view));
