"""What a diagnosis writes: files for programs, and a page with figures."""
