/**
 * EPSG codes of the projected systems whose first axis points north and whose second one points east, from the EPSG register. Numbers in base 36: the distance from
 * the last code of the previous run, and, after a dot, the length of the run less one.
 */
const NORTH_FIRST =
  "1kk,8.1,10.2,2.1,5.2,3.2,7.r,y.e,d,6.1,6.6,2z.6e,2.54,3.k,4x.6,c,1h.o,4.1,3.d,7.1,9,1a.4,2,6.e,6.1,3.2,44.1,r.7,b,4.2,e,k.4,6.3,8,7,2,9o,o.5" +
  ",2.1,11.l,j.c,m.4,37.c,aj,h,1l.1r,e.l,1r.4q,h.15,4o,1l.2b,1t.6,a.6,1w.6,i,34.2,11.2,16.q,18.7,c.2,gf.v,2f,a.f,7u.i,k.2,4h.6,2e,n9.2,o.6,gq.8" +
  ",gm.1,51.x,h.e,2k,3d,8z,a.a,a.e,u,av,2,2,g,n,lt.4,6uu.s,w.s,mk.s,20.s,4v.1l,17.4w,bh.3,7k.q,17,th.w,1yv,10p.r,4f.7,2m,pa.2i,xl.1,cr.i,h9,cj." +
  "8,g.f,4w.3,6f";

/** Does the first axis of a projected system point north? Codes that the register does not know have the easting first. */
export function isNorthFirst(epsg: number): boolean {
  let at = 0;
  for (const run of NORTH_FIRST.split(",")) {
    const [distance = "", length = "0"] = run.split(".");
    const first = at + parseInt(distance, 36);
    at = first + parseInt(length, 36);
    if (epsg <= at) return epsg >= first;
  }
  return false;
}

const EPSG = /EPSG\b[^]*?[:/#](\d{4,6})(?!\d)/i;

/** Returns the EPSG code of a system's name in any usual spelling, of a compound system that of its horizontal part; null without one. */
export function epsgOf(crs: string): number | null {
  const code = EPSG.exec(crs)?.[1];
  return code === undefined ? null : Number(code);
}

/** Do two names mean the same horizontal system? */
export const isSameSystem = (a: string, b: string): boolean => a === b || (epsgOf(a) !== null && epsgOf(a) === epsgOf(b));
