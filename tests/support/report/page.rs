//! A page as a browser's parser sees it: what it objects to, and elements by a few simple selectors.
#![allow(dead_code)]

use html5ever::tendril::TendrilSink;
use markup5ever_rcdom::{Handle, NodeData, RcDom};

/// A parsed page.
pub struct Page(RcDom);

impl Page {
    /// Parses a whole document.
    pub fn parse(html: &str) -> Self {
        Self(html5ever::parse_document(RcDom::default(), Default::default()).one(html))
    }

    /// What the parser objected to.
    pub fn errors(&self) -> Vec<String> {
        self.0.errors.borrow().iter().map(|e| e.to_string()).collect()
    }

    /// Elements by their descent: each step is `tag`, `#id` or `[attribute]`, steps stand apart by blanks.
    pub fn all(&self, selector: &str) -> Vec<Element> {
        let mut found = vec![Element(self.0.document.clone())];
        for step in selector.split(' ') {
            let mut next: Vec<Element> = Vec::new();
            for inside in found.iter().flat_map(Element::descendants).filter(|e| e.matches(step)) {
                if !next.iter().any(|e| std::rc::Rc::ptr_eq(&e.0, &inside.0)) {
                    next.push(inside);
                }
            }
            found = next;
        }
        found
    }

    /// How many elements there are, see [`Page::all`].
    pub fn count(&self, selector: &str) -> usize {
        self.all(selector).len()
    }
}

/// An element of a page.
pub struct Element(Handle);

impl Element {
    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<String> {
        let NodeData::Element { attrs, .. } = &self.0.data else { return None };
        attrs.borrow().iter().find(|a| &*a.name.local == name).map(|a| a.value.to_string())
    }

    /// All text inside.
    pub fn text(&self) -> String {
        let own = match &self.0.data {
            NodeData::Text { contents } => contents.borrow().to_string(),
            _ => String::new(),
        };
        let inside = self.0.children.borrow();
        inside.iter().fold(own, |text, child| text + &Element(child.clone()).text())
    }

    fn descendants(&self) -> Vec<Element> {
        let children = self.0.children.borrow();
        children
            .iter()
            .flat_map(|child| {
                let inside = Element(child.clone()).descendants();
                std::iter::once(Element(child.clone())).chain(inside)
            })
            .collect()
    }

    fn matches(&self, step: &str) -> bool {
        let NodeData::Element { name, .. } = &self.0.data else { return false };
        match (step.strip_prefix('#'), step.strip_prefix('[').and_then(|s| s.strip_suffix(']'))) {
            (Some(id), _) => self.attribute("id").is_some_and(|own| own == id),
            (_, Some(attribute)) => self.attribute(attribute).is_some(),
            _ => &*name.local == step,
        }
    }
}
