//! Which level of detail of each object is drawn.

use super::feature::{Form, Member, Placed};
use super::kinds::Kind;

/// Per feature: the level to draw, `None` for nothing.
pub fn choose(member: &Member, asked: Option<u8>) -> Vec<Option<u8>> {
    let objects: Vec<u32> = (0..member.features.len() as u32).map(|f| member.object_of(f)).collect();
    let shells = shells(member, &objects, asked);
    let finest_part = finest_parts(member, &shells);
    let level = |f: usize| {
        let object = objects[f] as usize;
        if asked.is_some() {
            return asked;
        }
        let hidden_by_parts = finest_part[object] > shells[object];
        match shells[object] {
            shell @ Some(_) if is_shell(member, f) => shell.filter(|_| !hidden_by_parts),
            Some(shell) if hidden_by_parts && has(member, f, shell) => None,
            Some(shell) if has(member, f, shell) => Some(shell),
            _ => best(member, f),
        }
    };
    (0..member.features.len()).map(level).collect()
}

/// The parts of an object that make its body: itself and its boundary surfaces, not doors, windows, balconies.
fn is_shell(member: &Member, feature: usize) -> bool {
    !matches!(member.features[feature].kind, Kind::Opening | Kind::Installation) && !below_installation(member, feature)
}

fn below_installation(member: &Member, feature: usize) -> bool {
    let parents = std::iter::successors(member.features[feature].parent, |p| member.features[*p as usize].parent);
    parents.take_while(|p| !member.features[*p as usize].is_object()).any(|p| member.features[p as usize].kind == Kind::Installation)
}

fn levels(member: &Member, feature: usize) -> impl Iterator<Item = u8> + '_ {
    member.features[feature].placed.iter().map(|p: &Placed| p.lod)
}

fn has(member: &Member, feature: usize, lod: u8) -> bool {
    levels(member, feature).any(|l| l == lod)
}

fn best(member: &Member, feature: usize) -> Option<u8> {
    levels(member, feature).max()
}

/// The best level of each object's body.
fn shells(member: &Member, objects: &[u32], asked: Option<u8>) -> Vec<Option<u8>> {
    let mut shells = vec![None; member.features.len()];
    if asked.is_some() {
        return shells;
    }
    for f in (0..member.features.len()).filter(|f| !member.features[*f].interior && is_shell(member, *f)) {
        let slot: &mut Option<u8> = &mut shells[objects[f] as usize];
        *slot = (*slot).max(best(member, f));
    }
    shells
}

/// The best level among the parts below each object: where it is finer than the object's own, the latter is their coarse outline.
fn finest_parts(member: &Member, shells: &[Option<u8>]) -> Vec<Option<u8>> {
    let mut finest = vec![None; member.features.len()];
    for (f, feature) in member.features.iter().enumerate().filter(|(_, f)| f.kind == Kind::Part) {
        let mut above = feature.parent;
        while let Some(a) = above {
            finest[a as usize] = shells[f].max(finest[a as usize]);
            above = member.features[a as usize].parent;
        }
    }
    finest
}

/// What of a feature is drawn at a level: roof edges only where there is nothing better.
pub fn drawn_at(placed: &[Placed], lod: u8) -> impl Iterator<Item = Form> + '_ {
    let better = placed.iter().any(|p| p.lod == lod && !matches!(p.form, Form::RoofEdge(_)));
    placed.iter().filter(move |p| p.lod == lod && !(better && matches!(p.form, Form::RoofEdge(_)))).map(|p| p.form)
}
