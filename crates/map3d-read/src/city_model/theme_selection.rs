//! Selects the theme of appearances of a document.

/// A theme, and what its appearances have.
#[derive(Clone, Debug, Default)]
struct Theme {
    name: String,
    /// Names of the images of its textures, one per texture.
    images: Vec<String>,
    /// Textures whose names are not kept.
    more_images: u64,
    materials: u64,
}

/// Selects the appearance theme: the requested one or, by default, the one with the most textures whose images are there; of equal ones, the first in
/// the file.
#[derive(Clone, Debug, Default)]
pub struct ThemeSelection {
    pub requested: Option<String>,
    /// Themes in document order.
    themes: Vec<Theme>,
    /// Index into `themes` of the default.
    default: usize,
    is_chosen: bool,
    /// Index of the theme registered last.
    current: usize,
}

/// Names of images that are kept for one theme; further textures count as there.
const MAX_IMAGES: usize = 1_000_000;

impl ThemeSelection {
    pub fn new(requested: Option<String>) -> Self {
        Self { requested, ..Self::default() }
    }

    /// Registers a theme. Must be called for all themes in document order.
    pub fn register(&mut self, name: &str) {
        self.current = self.themes.iter().position(|known| known.name == name).unwrap_or_else(|| {
            self.themes.push(Theme { name: name.to_owned(), ..Theme::default() });
            self.themes.len() - 1
        });
    }

    /// Counts a texture of the theme registered last.
    pub fn count_image(&mut self, name: &str) {
        if let Some(theme) = self.themes.get_mut(self.current) {
            match theme.images.len() < MAX_IMAGES {
                true => theme.images.push(name.to_owned()),
                false => theme.more_images += 1,
            }
        }
    }

    /// Counts a material of the theme registered last.
    pub fn count_material(&mut self) {
        if let Some(theme) = self.themes.get_mut(self.current) {
            theme.materials += 1;
        }
    }

    /// Chooses the default theme; everything is counted. `is_there`: whether the folder has the image of a name. Returns the themes whose images are
    /// all missing, with the name of one, if another theme is used for that.
    pub fn choose(&mut self, is_there: &mut dyn FnMut(&str) -> bool) -> Vec<String> {
        self.is_chosen = true;
        if self.themes.len() < 2 || self.requested.is_some() {
            return Vec::new();
        }
        let mut count = |theme: &Theme| theme.images.iter().filter(|image| is_there(image)).count() as u64 + theme.more_images;
        let found: Vec<u64> = self.themes.iter().map(&mut count).collect();
        let first_of = |scores: Vec<u64>| scores.iter().position(|score| Some(score) == scores.iter().max()).unwrap_or(0);
        let is_without_images = |theme: &Theme| theme.images.is_empty() && theme.materials > 0;
        self.default = match self.themes.iter().position(is_without_images) {
            _ if found.iter().any(|count| *count > 0) => first_of(found.clone()),
            Some(colored) => colored,
            None => first_of(self.themes.iter().map(|theme| theme.images.len() as u64).collect()),
        };
        let is_missed = |(k, theme): &(usize, &Theme)| *k != self.default && found[*k] == 0 && !theme.images.is_empty();
        self.themes.iter().enumerate().filter(is_missed).map(|(_, theme)| format!("{}: {}", theme.name, theme.images[0])).collect()
    }

    pub fn is_chosen(&self) -> bool {
        self.is_chosen
    }

    /// Returns the themes of the file, in document order.
    pub fn names(&self) -> Vec<&str> {
        self.themes.iter().map(|theme| theme.name.as_str()).collect()
    }

    /// The file has more than one theme.
    pub fn has_several(&self) -> bool {
        self.themes.len() > 1
    }

    pub fn selected(&self) -> Option<&str> {
        self.requested.as_deref().or_else(|| self.themes.get(self.default).map(|theme| theme.name.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn choose(themes: &[(&str, &[&str], u64)]) -> (String, usize) {
        let mut selection = ThemeSelection::new(None);
        for (name, images, materials) in themes {
            selection.register(name);
            images.iter().for_each(|image| selection.count_image(image));
            (0..*materials).for_each(|_| selection.count_material());
        }
        let missed = selection.choose(&mut |image| !image.starts_with("lost"));
        (selection.selected().unwrap_or_default().to_owned(), missed.len())
    }

    #[test]
    fn the_theme_with_most_images_that_are_there_is_chosen() {
        for (themes, expected) in [
            (&[("a", &["1"][..], 0), ("b", &["2"][..], 0)][..], ("a", 0)),
            (&[("a", &["1"], 0), ("b", &["2", "3"], 0)], ("b", 0)),
            (&[("a", &["lost"], 0), ("b", &["2"], 0)], ("b", 1)),
            (&[("a", &["lost", "lost2", "1"], 0), ("b", &["2", "3"], 0)], ("b", 0)),
            (&[("a", &["lost"], 0), ("b", &[], 3)], ("b", 1)),
            (&[("a", &["lost"], 0), ("b", &["lost2", "lost3"], 0)], ("b", 1)),
            (&[("a", &[], 0), ("b", &["lost"], 0)], ("b", 0)),
            (&[("a", &[], 2), ("b", &["2"], 0)], ("b", 0)),
            (&[("a", &[], 0), ("b", &[], 2)], ("b", 0)),
            (&[("a", &["lost"], 0)], ("a", 0)),
        ] {
            assert_eq!(choose(themes), (expected.0.to_owned(), expected.1), "{themes:?}");
        }
    }
}
